"""What lies between a vehicle and its ground station: messages get lost, late, doubled, and overtake each other."""

from __future__ import annotations

import heapq
import itertools
import random
import time
from collections.abc import Callable


class Schedule:
    """What is to be done when, by `time.monotonic`."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Callable[[], None]]] = []
        self._number = itertools.count()

    def at(self, when_s: float, do: Callable[[], None]) -> None:
        """Plan it."""
        heapq.heappush(self._heap, (when_s, next(self._number), do))

    def after(self, delay_s: float, do: Callable[[], None]) -> None:
        """Plan it from now."""
        self.at(time.monotonic() + delay_s, do)

    def run_due(self) -> float:
        """Do what is due; returns for how many seconds there is nothing to do."""
        while self._heap and self._heap[0][0] <= time.monotonic():
            heapq.heappop(self._heap)[2]()
        return max(self._heap[0][0] - time.monotonic(), 0.0) if self._heap else 1.0


class Air:
    """One way of a link, message by message, as a seed has it.

    Parameters
    ----------
    loss, double : share of messages that are lost, and that come twice
    delay_s : least and longest delay of each; where they differ, messages overtake each other
    """

    def __init__(self, seed: int, schedule: Schedule, loss: float, double: float, delay_s: tuple[float, float]) -> None:
        self._chance = random.Random(seed)
        self._schedule = schedule
        self._loss, self._double, self._delay_s = loss, double, delay_s
        self.silent = False

    def carry(self, arrive: Callable[[], None]) -> None:
        """Have one message arrive: once, twice or never."""
        if self.silent or self._chance.random() < self._loss:
            return
        for _ in range(2 if self._chance.random() < self._double else 1):
            self._schedule.after(self._chance.uniform(*self._delay_s), arrive)
