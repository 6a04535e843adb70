"""All that is made of one saved flight: replays of the parameter sets, their scores, and how far they can be trusted.

One process does it all, for its start, the reading of the flight, its reconstruction and the loading of the compiled
estimator together take longer than the work itself.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from fusetune.analyze.onboard_fidelity import FIDELITY_TOPICS, write_flight_fidelity
from fusetune.analyze.replay_flight import REPLAY_TOPICS, replay_flight
from fusetune.analyze.replay_settings import IN_USE, ReplaySettings
from fusetune.analyze.score_flight import SCORE_TOPICS, score_flight
from fusetune.analyze.settings import ScoringSettings
from fusetune.analyze.trust_settings import TrustSettings
from fusetune.files import AnyPath
from fusetune.px4.flight import Flight
from fusetune.save.flight_folder import load_flight


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
    flight = load_flight(flight_folder, topics={*REPLAY_TOPICS, *SCORE_TOPICS, *FIDELITY_TOPICS})
    prepared = replay_flight(_with_only(flight, REPLAY_TOPICS), replayed, output_folder, settings.replay)
    score_flight(_with_only(flight, SCORE_TOPICS), output_folder, scored, present=present, settings=settings.scoring)
    write_flight_fidelity(_with_only(flight, FIDELITY_TOPICS), output_folder, settings.replay, settings.trust, prepared)


def _with_only(flight: Flight, topics: Collection[str]) -> Flight:
    """What each step gets does not depend on what the others read."""
    return flight.with_topics({key: table for key, table in flight.topics.items() if key[0] in topics})
