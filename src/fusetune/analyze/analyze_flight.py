"""All that the pipeline makes of one saved flight: replays of the parameter sets, their scores, and how far they can be
trusted.

One process does it all, for its start, the reading of the flight, its reconstruction and the loading of the compiled
estimator together take longer than the work itself. Replays, grade and scores share one prepared flight; of it only
what scores need stays in memory while they are made.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from fusetune.analyze.replaying.onboard import onboard_samples
from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS, PreparedFlight, prepare_flight
from fusetune.analyze.replaying.replay_flight import write_replay
from fusetune.analyze.replaying.settings import IN_USE, ReplaySettings
from fusetune.analyze.scoring.score_flight import spooled_flight, write_scores
from fusetune.analyze.scoring.score_sets import SCORE_TOPICS, ScoredFlight
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.trust.as_flown_comparison import AsFlownComparison, AsFlownReplay
from fusetune.analyze.trust.as_flown_figures import compared_rows
from fusetune.analyze.trust.grade import TRUST_TOPICS, grade_flight
from fusetune.analyze.trust.onboard_fidelity import write_flight_fidelity
from fusetune.analyze.trust.settings import TrustSettings
from fusetune.ekf2.replay.recording import RecordArrays
from fusetune.ekf2.replay.replay import result_of
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.save.flight_folder import load_flight
from fusetune.set_names import AS_FLOWN, PRESENT
from fusetune.storage.files import AnyPath

COMPARED_TOPICS = (
    *(topic for topic in dict.fromkeys((*TRUST_TOPICS, *SCORE_TOPICS)) if topic not in REPLAY_TOPICS),
    "estimator_selector_status",
    "estimator_status",
)
"""What is read of a saved flight beside `REPLAY_TOPICS`, with what the canonical form of these topics depends on.

They take memory and are not asked for before the sets have been replayed.
"""


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
    write_scores(flight, output_folder, scored, present=present, settings=settings.scoring)


def _replay_and_grade(
    flight_folder: AnyPath,
    output_folder: AnyPath,
    replayed: Mapping[str, Mapping[str, float]],
    settings: AnalysisSettings,
) -> ScoredFlight:
    """All but the scores; what these need of the flight."""
    prepared = prepare_flight(load_flight(flight_folder, topics=REPLAY_TOPICS), settings.replay)
    write_replays(prepared, {name: values for name, values in replayed.items() if name != AS_FLOWN}, output_folder)
    prepared = prepared.with_log(canonical(load_flight(flight_folder, topics=COMPARED_TOPICS)))
    comparison = AsFlownComparison(prepared.flight, settings.trust)
    if AS_FLOWN in replayed:
        # the grade finds these figures made; the replay itself need not stay
        comparison.figures(prepared, write_as_flown(prepared, output_folder))
    grade = grade_flight(prepared, settings.replay, settings.trust, comparison)
    write_flight_fidelity(prepared, output_folder, grade)
    return spooled_flight(prepared.flight, output_folder, settings.scoring)


def write_replays(prepared: PreparedFlight, replayed: Mapping[str, Mapping[str, float]], folder: AnyPath) -> None:
    """Replay sets and write their files."""
    for name, overrides in replayed.items():
        write_replay(prepared, name, overrides, folder)


def write_as_flown(prepared: PreparedFlight, folder: AnyPath) -> AsFlownReplay:
    """Replay the parameters that flew and write their files; what the grade compares of the replay."""
    keep, kept = compared_rows(onboard_samples(prepared.flight)), list[RecordArrays]()
    summary = write_replay(prepared, AS_FLOWN, {}, folder, also=lambda rows: kept.append(keep(rows)))
    result = result_of(summary, kept)
    return AsFlownReplay(result, prepared.measured(result.innovations, prepared.parameters({}), result))
