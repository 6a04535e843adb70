"""All that the pipeline makes of one saved flight: replays of the parameter sets, their scores, and how far they can be
trusted.

One process does it all, for its start, the reading of the flight, its reconstruction and the loading of the compiled
estimator together take longer than the work itself. Replays, grade and scores share one prepared flight. Each step adds
what it reads of the log, and what no later one reads leaves the memory, so that this is that of the largest step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from fusetune.analyze.flight_files import ONBOARD_FILE
from fusetune.analyze.replaying.onboard import onboard_samples, with_onboard_columns, write_onboard
from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS, PreparedFlight, prepare_flight
from fusetune.analyze.replaying.replay_flight import write_replay
from fusetune.analyze.replaying.settings import IN_USE, ReplaySettings
from fusetune.analyze.scoring.score_flight import read_onboard, write_scores
from fusetune.analyze.scoring.score_sets import SCORE_TOPICS, scored_flight
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.trust.as_flown_comparison import AsFlownComparison, AsFlownReplay
from fusetune.analyze.trust.as_flown_figures import compared_rows
from fusetune.analyze.trust.grade import COMPARED_SOURCES, TRUST_TOPICS, TrustGrade, grade_flight
from fusetune.analyze.trust.onboard_fidelity import write_flight_fidelity
from fusetune.analyze.trust.settings import TrustSettings
from fusetune.ekf2.replay.kept_rows import KeptRows
from fusetune.ekf2.replay.replay import result_of
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.save.flight_folder import load_flight
from fusetune.set_names import AS_FLOWN, PRESENT
from fusetune.storage.files import AnyPath
from fusetune.storage.freed_memory import give_back_freed_memory

COMPARED_TOPICS = (
    *(topic for topic in TRUST_TOPICS if topic not in REPLAY_TOPICS),
    "estimator_selector_status",
    "estimator_status",
)
"""What is read of a saved flight when the sets have been replayed, with what its canonical form depends on."""

REFERENCE_TOPICS = tuple(topic for topic in SCORE_TOPICS if topic not in (*REPLAY_TOPICS, *COMPARED_TOPICS))
"""What is read of it when it has been graded."""


@dataclass(frozen=True)
class AnalysisSettings:
    """How a flight is replayed, scored and graded."""

    replay: ReplaySettings = IN_USE
    scoring: ScoringSettings = field(default_factory=ScoringSettings)
    trust: TrustSettings = field(default_factory=TrustSettings)


def analyze_flight(
    flight_folder: AnyPath,
    output_folder: AnyPath,
    replayed: Mapping[str, Mapping[str, float]],
    scored: Sequence[str],
    *,
    present: str = PRESENT,
    settings: AnalysisSettings | None = None,
) -> None:
    """Replay some sets on a saved flight, then grade the flight and score all sets.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    output_folder : `results/analyze/<flight>`; takes the replays, and holds those of the other sets already
    replayed : name of each set to be replayed → its overrides of the log's own parameters
    scored : names of all sets, the present one among them or added

    Raises
    ------
    UserError
        If the saved flight, or a file of a replay made before, is missing or damaged.
    """
    settings = settings or AnalysisSettings()
    flight = _replay_and_grade(flight_folder, output_folder, replayed, settings)
    flight = flight.with_more(canonical(load_flight(flight_folder, topics=REFERENCE_TOPICS)))
    to_score = scored_flight(flight, settings.scoring, read_onboard(output_folder))
    del flight
    give_back_freed_memory()
    write_scores(to_score, output_folder, scored, present=present, settings=settings.scoring)


def _replay_and_grade(
    flight_folder: AnyPath,
    output_folder: AnyPath,
    replayed: Mapping[str, Mapping[str, float]],
    settings: AnalysisSettings,
) -> Flight:
    """All but the scores; the flight, canonical, with what was read of it."""
    prepared = prepare_flight(load_flight(flight_folder, topics=REPLAY_TOPICS), settings.replay)
    write_replays(prepared, {name: values for name, values in replayed.items() if name != AS_FLOWN}, output_folder)
    flight = prepared.flight.with_more(canonical(load_flight(flight_folder, topics=COMPARED_TOPICS)))
    write_onboard(Path(output_folder) / ONBOARD_FILE, onboard_samples(flight))
    flight = with_onboard_columns(flight, COMPARED_SOURCES)
    prepared = prepared.with_flight(flight)
    give_back_freed_memory()
    comparison = AsFlownComparison(flight, settings.trust)
    if AS_FLOWN in replayed:
        # the grade finds these figures made; the replay itself need not stay
        comparison.figures(prepared, write_as_flown(prepared, output_folder))
    grade = grade_flight(prepared, settings.replay, settings.trust, comparison)
    write_flight_fidelity(prepared, output_folder, grade)
    return flight


def grade_saved_flight(flight_folder: AnyPath, settings: AnalysisSettings) -> TrustGrade:
    """Grade a saved flight as `analyze_flight` does, without what the causes cost; nothing is written.

    Raises
    ------
    UserError
        If the saved flight is missing or damaged.
    """
    flight = canonical(load_flight(flight_folder, topics={*REPLAY_TOPICS, *COMPARED_TOPICS}))
    prepared = prepare_flight(flight, settings.replay).with_flight(with_onboard_columns(flight, COMPARED_SOURCES))
    return grade_flight(prepared, settings.replay, replace(settings.trust, causes=False))


def write_replays(prepared: PreparedFlight, replayed: Mapping[str, Mapping[str, float]], folder: AnyPath) -> None:
    """Replay sets and write their files."""
    for name, overrides in replayed.items():
        write_replay(prepared, name, overrides, folder)


def write_as_flown(prepared: PreparedFlight, folder: AnyPath) -> AsFlownReplay:
    """Replay the parameters that flew and write their files; what the grade compares of the replay."""
    kept = KeptRows(compared_rows(onboard_samples(prepared.flight)))
    result = result_of(write_replay(prepared, AS_FLOWN, {}, folder, also=kept.take), kept.rows())
    return AsFlownReplay(result, prepared.measured(result.innovations, prepared.parameters({}), result))
