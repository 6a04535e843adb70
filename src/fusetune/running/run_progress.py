"""How far a run of the workflow is: what is being done, flights done, time left."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable

from fusetune.running.workflow_events import Counted, Event, JobBegun, JobDone, JobFailed, Planned

COSTS_S = {
    "simulate_flight": 0.6,
    "save_flight": 0.25,
    "tell_flight": 0.8,
    "analyze_flight": 2.0,
    "flight_page": 0.3,
    "join_conformance": 1.0,
    "decide": 1.5,
    "build_report": 1.5,
    "search_try": 20.0,
    "search_flights": 2.0,
}
"""What a job of a rule takes, s of processor: public flights with a study of seven sets. The rules of one round of a
search are named for it and its number."""
OTHER_COST_S = 0.4
"""Of any other."""

ASKED_LATER = {"list_flights": {"analyze_flight": "save_flight"}}
"""Checkpoints → rules that have jobs only when they are done → the rule that is known to have about as many."""

UNSTEADY = "compile_kernels"
"""Takes minutes once and nothing from then on: how long it took says nothing of the rest."""

FEWEST_DONE_S = 2.0
"""Cost of what has to be done before the time that is left can be told."""


class RunProgress:
    """Takes the events of a run, and tells where it is.

    Parameters
    ----------
    clock : seconds, for tests

    Attributes
    ----------
    now : jobs at work, those that began last at the end
    done, total : jobs, as far as they are known
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.now: dict[int, JobBegun] = {}
        self.done, self.total = 0, 0
        self._clock = clock
        self._expected: Counter[str] = Counter()
        self._begun: Counter[str] = Counter()
        self._ended: Counter[str] = Counter()
        self._flights: dict[str, set[str]] = {}
        self._steady_since, self._steady_from = clock(), 0.0

    def take(self, event: Event) -> None:
        """Know of an event."""
        if isinstance(event, Planned):
            self._plan(event)
        elif isinstance(event, Counted):
            self.done, self.total = event.done, event.total
        elif isinstance(event, JobBegun):
            if not self._begun:
                # planning is no part of the pace
                self._steady_since = self._clock()
            self.now[event.number] = event
            self._begun[event.rule] += 1
            self._expected[event.rule] = max(self._expected[event.rule], self._begun[event.rule])
        elif isinstance(event, JobDone | JobFailed):
            job = self.now.pop(event.number, None)
            if job is not None:
                self._end(job)

    @property
    def flights(self) -> int:
        """Flights that the run works on; 0 where none has anything to be done."""
        return max((self._expected[rule] for rule in ("analyze_flight", "save_flight", "tell_flight")), default=0)

    @property
    def flights_done(self) -> int:
        """Flights that are replayed and scored."""
        return len(self._flights.get("analyze_flight", ()))

    @property
    def share(self) -> float:
        """How much of the work is done, 0 … 1."""
        whole = sum(_cost(rule) * count for rule, count in self._expected.items())
        return min(self._done_s / whole, 1.0) if whole else 0.0

    @property
    def left_s(self) -> float | None:
        """Time that is left at the pace so far, s; None where too little is done to tell."""
        worked = self._done_s - self._steady_from
        if worked < FEWEST_DONE_S or UNSTEADY in {job.rule for job in self.now.values()}:
            return None
        whole = sum(_cost(rule) * count for rule, count in self._expected.items())
        return (whole - self._done_s) * (self._clock() - self._steady_since) / worked

    @property
    def _done_s(self) -> float:
        return sum(_cost(rule) * count for rule, count in self._ended.items())

    def _plan(self, event: Planned) -> None:
        self.total = sum(event.jobs.values())
        self._expected.update(event.jobs)
        for checkpoint, rules in ASKED_LATER.items():
            if checkpoint in event.jobs:
                for rule, like in rules.items():
                    self._expected[rule] = max(self._expected[rule], self._expected[like])

    def _end(self, job: JobBegun) -> None:
        self._ended[job.rule] += 1
        if job.flight:
            self._flights.setdefault(job.rule, set()).add(job.flight)
        if job.rule == UNSTEADY:
            self._steady_since, self._steady_from = self._clock(), self._done_s


def _cost(rule: str) -> float:
    own = max((name for name in COSTS_S if rule.startswith(name)), key=len, default="")
    return COSTS_S.get(own, OTHER_COST_S)
