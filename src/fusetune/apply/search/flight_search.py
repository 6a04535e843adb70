"""A search on saved flights, from the first replay to `best_params.params` and `search.json`."""

from __future__ import annotations

import json
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
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.kept_pairs import KeptPairs
from fusetune.apply.search.objective import objective
from fusetune.apply.search.plan import ALL, plan_of
from fusetune.apply.search.progress import Progress
from fusetune.apply.search.replays import ReplayGround
from fusetune.apply.search.requests import values_of
from fusetune.apply.search.result import candidate_documents, gain_percent, parameter_documents, search_documents
from fusetune.apply.search.rounds import AskedRound, Searched, run_searches, searches
from fusetune.apply.search.settings import SearchSettings
from fusetune.apply.search.space import Space
from fusetune.apply.search.stages import Ask, Found
from fusetune.apply.search.words import alone_sentences, search_sentences
from fusetune.apply.search.workers import WorkerTrier
from fusetune.apply.settings import DecisionSettings
from fusetune.save.flight_folder import read_metadata
from fusetune.set_names import AS_FLOWN, FOUND, PRESENT
from fusetune.storage.digest import source_digest
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.ledger import key_of

FEWEST_FLIGHTS = 6
"""With fewer flights what is kept aside shows too little: the decision is called exploratory."""

_SIGNIFICANT_DIGITS = 9


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
    """What the searches found; `aside` has the differences on the flights that each did not see, in order of time."""

    studied: Sequence[Searched]
    found: Sequence[Found]
    asked: Sequence[AskedRound]
    on_all: Comparison
    aside: Mapping[str, float]


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
    document = _document(given, outcome, read_document(target / "decision.json"))
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
    asks = [(one.aside, Ask(ALL, present, (values_of(what.values),))) for one, what in zip(studied, found, strict=True)]
    on_all, *others = ground.compare([(studied[0].flights, asks[0][1]), *asks[1:]])
    differences = [
        (name, value)
        for one, compared in zip(studied[1:], others, strict=True)
        for name, value in zip(one.aside, compared.differences[0].tolist(), strict=True)
    ]
    return _Outcome(studied, found, asked, on_all, dict(differences))


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
        sets=[PRESENT, FOUND] if outcome.aside else [PRESENT],
        present=PRESENT,
        newest_flight=given.present_flight,
        same_present=given.same_present,
        descriptions={FOUND: "what the search found; on each flight, what it found without that flight"},
        recommended=recommended,
        settings=replace(given.decision, minimum_flights=max(given.decision.minimum_flights, FEWEST_FLIGHTS)),
    )


def _document(given: FlightSearch, outcome: _Outcome, decision: Mapping[str, Any]) -> dict[str, Any]:
    found = outcome.found[0]
    row = next((one for one in decision["ranking"] if one["name"] == FOUND), None)
    figures = {
        "status": decision["status"],
        "exploratory": decision["exploratory"],
        "parameters_found": {
            name: found.values[name] for name in found.values if found.values[name] != given.present.get(name)
        },
        "parameters_kept": [name for name in given.space.parameters if name not in found.changed],
        "expected_gain": _expected(row),
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
        "searches": search_documents(outcome.studied, outcome.found),
        "flights": list(given.flights),
        "flights_left_out": dict(given.left_out),
        "settings": asdict(given.search),
        "candidates": candidate_documents(outcome.asked),
    }
    document["paragraphs"] = [*decision["paragraphs"], *search_sentences(document)]
    return json.loads(json.dumps(_rounded(document)))  # type: ignore[no-any-return]


def _expected(row: Mapping[str, Any] | None) -> dict[str, float] | None:
    """Gain to be expected on flights to come, percent, and its interval; None where nothing was kept aside."""
    if row is None or row["difference"] is None:
        return None
    lower, upper = (None if row[name] is None else improvement_percent(row[name]) for name in ("upper", "lower"))
    return {"percent": improvement_percent(row["difference"]), "lower_percent": lower, "upper_percent": upper}  # type: ignore[dict-item]


def _rounded(value: Any) -> Any:
    """Floats with nine significant digits: the last bits may differ between machines."""
    if isinstance(value, float):
        return float(f"{value:.{_SIGNIFICANT_DIGITS}g}") if np.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    return value
