"""How far a search is, for whoever waits: the round, the best score so far, the time left."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from fusetune.apply.ranking import improvement_percent
from fusetune.apply.search.plan import Plan
from fusetune.apply.search.rounds import Searched


class Progress:
    """Tells a line when a round begins, and as it goes on, no more often than every few seconds.

    Parameters
    ----------
    told : takes the lines
    clock : seconds, for tests
    """

    EVERY_S = 5.0

    def __init__(
        self,
        plan: Plan,
        studied: Sequence[Searched],
        told: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._rounds, self._told, self._clock = plan.rounds, told, clock
        self._pairs_per_set = sum(len(one.flights) for one in studied)
        self._number, self._best = 0, 0.0
        self._replayed, self._replaying_s, self._last, self._begun = 0, 0.0, -self.EVERY_S, clock()

    def begin(self, number: int) -> None:
        """A round begins."""
        # the last round, on flights kept aside, is not among those planned for a search
        self._number, self._begun = min(number, len(self._rounds)), self._clock()
        self._before = self._replayed

    def better(self, objective: float) -> None:
        """The best so far that the search on all flights has, nat."""
        self._best = min(self._best, objective)

    def replayed(self, done: int, number: int) -> None:
        """So many replays of a round are done."""
        now = self._clock()
        self._replayed = self._before + done
        if done < number and now - self._last < self.EVERY_S:
            return
        self._last = now
        self._replaying_s += now - self._begun
        self._begun = now
        left = sum(size for _, size in self._rounds[self._number :]) * self._pairs_per_set + number - done
        seconds = self._replaying_s / max(self._replayed, 1) * left
        stage = self._rounds[min(self._number, len(self._rounds)) - 1][0]
        gain = f", errors {improvement_percent(self._best):.1f} % smaller so far" if self._best < 0.0 else ""
        self._told(
            f"round {self._number} of {len(self._rounds)} ({stage}): {done} of {number} replays{gain}, "
            f"{_in_words(seconds)} left at the most"
        )


def _in_words(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"
