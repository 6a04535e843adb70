"""A search on saved flights, from the first replay to `best_params.params` and `search.json`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fusetune.analyze.analyze_flight import AnalysisSettings, analyze_flight
from fusetune.analyze.trials.tried_flight import TrialSettings
from fusetune.apply.decide import decide
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.found_sets import (
    DESCRIPTION,
    FoundSets,
    found_sets,
    search_decision,
    write_search_document,
)
from fusetune.apply.search.kept_pairs import KeptPairs
from fusetune.apply.search.objective import lowest_on_all
from fusetune.apply.search.outcome import Outcome, outcome_rounds
from fusetune.apply.search.plan import plan_of
from fusetune.apply.search.progress import Progress
from fusetune.apply.search.replays import ReplayGround
from fusetune.apply.search.requests import Ask
from fusetune.apply.search.rounds import answered, searches
from fusetune.apply.search.space import Space
from fusetune.apply.search.trial_keys import made_of, trial_settings
from fusetune.apply.search.what_matters import what_matters
from fusetune.apply.search.workers import WorkerTrier
from fusetune.apply.settings import DecisionSettings
from fusetune.design.search_settings import SearchSettings
from fusetune.set_names import AS_FLOWN, FOUND, PRESENT
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class FlightSearch:
    """What is searched, on which flights, and how.

    Attributes
    ----------
    flights : saved flights of one vehicle that are searched on, one at least, by name, in order of time
    left_out : others of the vehicle, and why
    flights_table : of all flights, those of other vehicles and the refused ones, too
    present_flight : by whose log the vehicle's present parameters are known
    same_present : flights that have the same, the newest first
    present_values : of all that a set of the search may change, as far as that log knows them
    space : its origin is the present set
    """

    flights: Mapping[str, Path]
    left_out: Mapping[str, str]
    flights_table: Path
    present_flight: str
    same_present: Sequence[str]
    present_values: Mapping[str, float]
    space: Space
    search: SearchSettings = field(default_factory=SearchSettings)
    decision: DecisionSettings = field(default_factory=DecisionSettings)
    analysis: AnalysisSettings = field(default_factory=AnalysisSettings)

    @property
    def trials(self) -> TrialSettings:
        """What is compared of each flight."""
        return trial_settings(self.decision, self.analysis)


def search_flights(given: FlightSearch, folder: AnyPath, processes: int, told: Callable[[str], None]) -> dict[str, Any]:
    """Search, decide, and write `best_params.params`, `search.json` and all that the decision writes.

    Parameters
    ----------
    folder : takes the files; what a search that was stopped tried there is not tried again
    processes : that replay; the files are the same with any number
    told : is given lines about how far it is

    Returns
    -------
    What `search.json` holds
    """
    target = Path(folder)
    trier = WorkerTrier(given.flights, given.trials, processes)
    try:
        outcome = _searched(given, trier, target, told)
        matters = what_matters(outcome, given.space, given.decision)
        found = found_sets(outcome, given.space, given.search, given.left_out, given.present_values, matters.sentences)
        told("judging what was found on the flights that were kept aside")
        _analyze(given, found, target, trier.pool)
    finally:
        trier.close()
    _decide(given, found, target)
    matters.write(target)
    return write_search_document(target / "search.json", found, read_document(target / "decision.json"))


def _searched(given: FlightSearch, trier: WorkerTrier, target: Path, told: Callable[[str], None]) -> Outcome:
    plan, studied = plan_of(given.space, given.search), searches(list(given.flights), given.search)
    progress = Progress(plan, studied, told)
    pairs = KeptPairs(target / "tried", made_of(given.flights, given.trials))
    ground = ReplayGround(trier, given.decision, pairs.keep, progress.replayed)
    for batch, tried in pairs.kept():
        ground.know(batch, tried)
    rounds = outcome_rounds(list(given.flights), given.space, given.search)
    return answered(rounds, _Watched(ground, progress), progress.begin)


class _Watched:
    """A ground whose best answer to the search on all flights is told."""

    def __init__(self, ground: ReplayGround, progress: Progress) -> None:
        self._ground, self._progress = ground, progress

    def compare(self, asks: Sequence[tuple[Sequence[str], Ask]]) -> list[Comparison]:
        answers = self._ground.compare(asks)
        self._progress.better(lowest_on_all(asks, answers))
        return answers


def _analyze(given: FlightSearch, found: FoundSets, target: Path, pool: Executor) -> None:
    """Replay and score the present set and what was found without each flight, as the pipeline does."""
    running = []
    for name, folder in given.flights.items():
        sets = {FOUND: found.on_flights[name]} if name in found.on_flights else {}
        running.append(
            pool.submit(
                analyze_flight,
                folder,
                target / "analyze" / name,
                {PRESENT: given.present_values, AS_FLOWN: {}, **sets},
                [PRESENT, *sets],
                present=PRESENT,
                settings=given.analysis,
            )
        )
    for one in running:
        one.result()


def _decide(given: FlightSearch, found: FoundSets, target: Path) -> None:
    decide(
        [target / "analyze" / name for name in given.flights],
        given.flights_table,
        target,
        sets=found.decided,
        present=PRESENT,
        newest_flight=given.present_flight,
        same_present=given.same_present,
        descriptions={FOUND: DESCRIPTION},
        recommended=found.recommended,
        saved=given.flights_table.parent,
        settings=search_decision(given.decision),
    )
