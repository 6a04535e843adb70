"""All that is made of one saved flight: replays of the parameter sets, their scores, and how far they can be trusted.

One process does it all, for its start, the reading of the flight, its reconstruction and the loading of the compiled
estimator together take longer than the work itself. It takes one step after the other, each with the topics that it
needs, so that memory is that of the largest step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from fusetune.analyze.replaying.replay_flight import REPLAY_TOPICS, replay_flight
from fusetune.analyze.replaying.replay_settings import IN_USE, ReplaySettings
from fusetune.analyze.scoring.score_flight import SCORE_TOPICS, score_flight
from fusetune.analyze.scoring.scoring_settings import ScoringSettings
from fusetune.analyze.trust.onboard_fidelity import FIDELITY_TOPICS, graded, write_flight_fidelity
from fusetune.analyze.trust.trust_grade import TRUST_TOPICS, TrustGrade
from fusetune.analyze.trust.trust_settings import TrustSettings
from fusetune.save.flight_folder import load_flight
from fusetune.storage.files import AnyPath


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
    present: str = "present",
    settings: AnalysisSettings | None = None,
) -> None:
    """Replay some sets on a saved flight, then score all of them and grade the flight.

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
    grade = _replay_and_grade(flight_folder, output_folder, replayed, settings)
    score_flight(
        load_flight(flight_folder, topics=SCORE_TOPICS),
        output_folder,
        scored,
        present=present,
        settings=settings.scoring,
    )
    flight = load_flight(flight_folder, topics=FIDELITY_TOPICS)
    write_flight_fidelity(flight, output_folder, settings.replay, settings.trust, grade)


def _replay_and_grade(
    flight_folder: AnyPath,
    output_folder: AnyPath,
    replayed: Mapping[str, Mapping[str, float]],
    settings: AnalysisSettings,
) -> TrustGrade:
    """The grade is made of the same samples as the replays; nothing of them is in memory when the sets are scored."""
    flight = load_flight(flight_folder, topics=REPLAY_TOPICS)
    prepared = replay_flight(flight, replayed, output_folder, settings.replay)
    compared = load_flight(flight_folder, topics={*TRUST_TOPICS} - {*REPLAY_TOPICS})
    flight = flight.with_topics(dict(sorted((flight.topics | compared.topics).items())))
    return graded(flight, settings.replay, settings.trust, prepared)
