"""A search on saved flights, from the first replay to `best_params.params` and `search.json`."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from fusetune import __version__
from fusetune.analyze.analyze_flight import AnalysisSettings, analyze_flight, grade_saved_flight
from fusetune.analyze.trials.tried_flight import TrialSettings
from fusetune.analyze.trust.settings import reaches
from fusetune.apply.decide import decide
from fusetune.apply.ranking import improvement_percent
from fusetune.apply.recommended import Recommended
from fusetune.apply.rounded import rounded
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.kept_pairs import KeptPairs
from fusetune.apply.search.objective import objective
from fusetune.apply.search.plan import ALL, plan_of
from fusetune.apply.search.progress import Progress
from fusetune.apply.search.replays import ReplayGround
from fusetune.apply.search.requests import values_of
from fusetune.apply.search.result import candidate_documents, gain_percent, parameter_documents, search_documents
from fusetune.apply.search.rounds import AskedRound, Searched, run_searches, searches
from fusetune.apply.search.search_trials import search_trials
from fusetune.apply.search.settings import SearchSettings
from fusetune.apply.search.space import Space
from fusetune.apply.search.stages import Ask, Found
from fusetune.apply.search.words import alone_sentences, search_sentences
from fusetune.apply.search.workers import WorkerTrier
from fusetune.apply.sensitivity.files import SENSITIVITY_FILE, write_sensitivity
from fusetune.apply.sensitivity.sensitivity import sensitivity
from fusetune.apply.sensitivity.wording import sentences
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.trials import Trials
from fusetune.apply.trials_file import TRIALS_FILE, write_trials
from fusetune.save.flight_folder import read_metadata
from fusetune.set_names import AS_FLOWN, FOUND, PRESENT
from fusetune.storage.digest import source_digest
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.ledger import key_of

FEWEST_FLIGHTS = 6
"""With fewer flights what is kept aside shows too little: the decision is called exploratory."""


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
    space : its origin is the present set
    """

    flights: Mapping[str, Path]
    left_out: Mapping[str, str]
    flights_table: Path
    present_flight: str
    same_present: Sequence[str]
    space: Space
    search: SearchSettings = field(default_factory=SearchSettings)
    decision: DecisionSettings = field(default_factory=DecisionSettings)
    analysis: AnalysisSettings = field(default_factory=AnalysisSettings)

    @property
    def trials(self) -> TrialSettings:
        """What is compared of each flight: what decides, and no more."""
        withheld = sorted({key.partition(".")[0] for key in self.decision.withheld_sources})
        return TrialSettings(
            self.analysis.replay, self.analysis.scoring, tuple(sorted(self.decision.sources)), tuple(withheld)
        )

    @property
    def present(self) -> dict[str, float]:
        """The present values of all factors."""
        return self.space.values(np.zeros(len(self.space.factors)))


@dataclass(frozen=True)
class _Outcome:
    """What the searches found.

    Attributes
    ----------
    on_all : what was found on all flights, there
    on_seen : of each search, its differences on the flights that it saw
    aside : differences on the flights that each did not see, by flight, in order of time
    trials : what the search on all flights tried
    """

    studied: Sequence[Searched]
    found: Sequence[Found]
    asked: Sequence[AskedRound]
    on_all: Comparison
    on_seen: Sequence[Sequence[float]]
    aside: Mapping[str, float]
    trials: Trials | None


def trusted_flights(
    folders: Mapping[str, Path], analysis: AnalysisSettings, lowest_grade: str, pool: Executor
) -> tuple[list[str], dict[str, str]]:
    """Flights whose replay is trusted enough to search on, and why others are not."""
    taken, left_out = [], {}
    for name, grade in zip(
        folders, pool.map(grade_saved_flight, folders.values(), [analysis] * len(folders)), strict=True
    ):
        if reaches(grade.grade if grade.is_compared else None, lowest_grade):
            taken.append(name)
        else:
            left_out[name] = f"its replay has trust grade {grade.grade}, and none below {lowest_grade} is taken"
    return taken, left_out


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
        told("judging what was found on the flights that were kept aside")
        _analyze(given, outcome, target, trier.pool)
    finally:
        trier.close()
    _decide(given, outcome, target)
    told_of_parameters = _write_what_matters(given, outcome, target)
    document = _document(given, outcome, read_document(target / "decision.json"), told_of_parameters)
    with atomic_path(target / "search.json") as temporary:
        write_document(temporary, document, allow_nan=False)
    return document


def _searched(given: FlightSearch, trier: WorkerTrier, target: Path, told: Callable[[str], None]) -> _Outcome:
    studied = searches(list(given.flights), given.search)
    progress = Progress(plan_of(given.space, given.search), studied, told)
    pairs = KeptPairs(target / "tried", _made_of(given))
    ground = ReplayGround(trier, given.decision, pairs.keep, progress.replayed)
    for batch, tried in pairs.kept():
        ground.know(batch, tried)
    found, asked = run_searches(studied, given.space, given.search, _Watched(ground, progress), progress.begin)
    present = values_of(given.present)
    whats = [values_of(one.values) for one in found]
    asks = [Ask(ALL, present, (what,), seen_by=what) for what in whats]
    seen = [(one.flights, ask) for one, ask in zip(studied, asks, strict=True)]
    kept_aside = [(one.aside, ask) for one, ask in zip(studied, asks, strict=True) if one.aside]
    compared = ground.compare([*seen, *kept_aside])
    on_seen, others = compared[: len(seen)], compared[len(seen) :]
    differences = [
        (name, value)
        for (flights, _), one in zip(kept_aside, others, strict=True)
        for name, value in zip(flights, one.differences[0].tolist(), strict=True)
    ]
    trials = search_trials(given.space, asked, found[0], ground)
    each = [one.differences[0].tolist() for one in on_seen]
    return _Outcome(studied, found, asked, on_seen[0], each, dict(differences), trials)


class _Watched:
    """A ground whose best answer to the search on all flights is told."""

    def __init__(self, ground: ReplayGround, progress: Progress) -> None:
        self._ground, self._progress = ground, progress

    def compare(self, asks: Sequence[tuple[Sequence[str], Ask]]) -> list[Comparison]:
        answers = self._ground.compare(asks)
        scores = objective(answers[0])
        if scores.size:
            self._progress.better(float(scores.min()))
        return answers


def _made_of(given: FlightSearch) -> dict[str, str]:
    """What the figures of a flight follow from beside base and set."""
    program = source_digest("px4", "ekf2", "save", "analyze")
    return {
        name: key_of([read_metadata(folder)["checksum"], program, asdict(given.trials)])
        for name, folder in given.flights.items()
    }


def _found_without(given: FlightSearch, outcome: _Outcome) -> dict[str, dict[str, float]]:
    """By flight, what was found without it."""
    return {
        name: found.values
        for one, found in zip(outcome.studied[1:], outcome.found[1:], strict=True)
        for name in one.aside
    }


def _analyze(given: FlightSearch, outcome: _Outcome, target: Path, pool: Executor) -> None:
    """Replay and score the present set and what was found without each flight, as the pipeline does."""
    found = _found_without(given, outcome)
    varied = {*given.present, *(name for one in outcome.found for name in one.values)}
    running = []
    for name, folder in given.flights.items():
        now = _present_on(given, varied)
        sets = {PRESENT: now, AS_FLOWN: {}} | ({FOUND: now | found[name]} if name in found else {})
        scored = [PRESENT, *([FOUND] if name in found else [])]
        running.append(
            pool.submit(
                analyze_flight,
                folder,
                target / "analyze" / name,
                sets,
                scored,
                present=PRESENT,
                settings=given.analysis,
            )
        )
    for one in running:
        one.result()


def _present_on(given: FlightSearch, varied: set[str]) -> dict[str, float]:
    """The present values of all that any set changes, what goes along with a factor, too."""
    known = read_metadata(given.flights[given.present_flight])["ekf2_parameters"] if varied else {}
    return {name: known[name] for name in sorted(varied) if name in known} | given.present


def _decide(given: FlightSearch, outcome: _Outcome, target: Path) -> None:
    found = outcome.found[0]
    recommended = Recommended(
        FOUND, found.values, alone_sentences(found), tuple(outcome.on_all.objections[0]) if found.changed else ()
    )
    decide(
        [target / "analyze" / name for name in given.flights],
        given.flights_table,
        target,
        sets=[PRESENT, FOUND] if outcome.aside and found.changed else [PRESENT],
        present=PRESENT,
        newest_flight=given.present_flight,
        same_present=given.same_present,
        descriptions={FOUND: "what the search found; on each flight, what it found without that flight"},
        recommended=recommended,
        settings=replace(given.decision, minimum_flights=max(given.decision.minimum_flights, FEWEST_FLIGHTS)),
    )


def _write_what_matters(given: FlightSearch, outcome: _Outcome, target: Path) -> Sequence[str]:
    """Write all that was tried, and what it tells of the parameters; returns that in words.

    The decision sees two sets, which tell nothing of any one parameter.
    """
    trials, found = outcome.trials, None
    write_trials(target / TRIALS_FILE, trials)
    if trials is not None:
        incumbent = [outcome.found[0].values[name] for name in trials.parameters]
        found = sensitivity(trials, incumbent, confidence=given.decision.confidence, seed=given.decision.seed)
    write_sensitivity(target / SENSITIVITY_FILE, found)
    return sentences(found) if found is not None else ()


def _document(
    given: FlightSearch, outcome: _Outcome, decision: Mapping[str, Any], told_of_parameters: Sequence[str]
) -> dict[str, Any]:
    found = outcome.found[0]
    row = next((one for one in decision["ranking"] if one["name"] == FOUND), None)
    figures = {
        "status": decision["status"],
        "exploratory": decision["exploratory"],
        "parameters_found": {
            name: found.values[name] for name in found.values if found.values[name] != given.present.get(name)
        },
        "parameters_kept": [name for name in given.space.parameters if name not in found.changed],
        "expected_gain": _expected(row) if found.changed else None,
        "gain_in_search_percent": gain_percent(outcome.on_all.differences[0].tolist()),
        "gain_kept_aside_percent": gain_percent(list(outcome.aside.values())),
        "kept_aside": {name: gain_percent([value]) for name, value in outcome.aside.items()},
        "objections": list(outcome.on_all.objections[0]),
    }
    document = {
        "product": f"fusetune {__version__}",
        **figures,
        "paragraphs": [],
        "parameters": parameter_documents(found, given.space),
        "searches": search_documents(outcome.studied, outcome.found, outcome.on_seen, outcome.aside),
        "flights": list(given.flights),
        "flights_left_out": dict(given.left_out),
        "settings": asdict(given.search),
        "candidates": candidate_documents(outcome.asked),
    }
    document["paragraphs"] = [*decision["paragraphs"], *search_sentences(document), *told_of_parameters]
    return json.loads(json.dumps(rounded(document)))  # type: ignore[no-any-return]


def _expected(row: Mapping[str, Any] | None) -> dict[str, float | None] | None:
    """Gain to be expected on as many flights again, percent, and its interval; None where nothing was kept aside.

    The interval of the decision is one of the mean over all flights to come. That of the mean over as many flights as
    were searched on is wider by √2, for these vary as much again.
    """
    if row is None or row["difference"] is None:
        return None
    middle = row["difference"]
    ends = [None if row[one] is None else middle + math.sqrt(2.0) * (row[one] - middle) for one in ("upper", "lower")]
    lower, upper = (None if one is None else improvement_percent(one) for one in ends)
    return {"percent": improvement_percent(middle), "lower_percent": lower, "upper_percent": upper}
