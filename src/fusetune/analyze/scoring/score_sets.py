"""The scores of the parameter sets of one flight, all on the same samples; nothing here is written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from fusetune.analyze.flight.phases import IMU_TOPICS, imu_gaps
from fusetune.analyze.flight.reference_truth import TRUTH_TOPICS
from fusetune.analyze.replaying.onboard import INNOVATION_TOPICS, onboard_samples
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.scoring.set_scores import SetScores, score_flight, score_set
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.yardstick import WITH_MEASURED_ANTENNA, ScoredFlight, Yardstick
from fusetune.px4.flight import Flight
from fusetune.set_names import PRESENT

SCORE_TOPICS = (
    *dict.fromkeys(
        (
            "vehicle_land_detected",
            *IMU_TOPICS,
            *TRUTH_TOPICS,
            "vehicle_air_data",
            "estimator_selector_status",
            "estimator_status",
            *INNOVATION_TOPICS,
        )
    ),
)
"""What the metrics need of a saved flight."""


@dataclass(frozen=True)
class FlightScores:
    """Scores of all sets on one flight.

    Attributes
    ----------
    metrics : all figures, see `fusetune.analyze.scoring.metrics_schema`
    blocks : sums over blocks of about 10 s, which the decision draws from, see `block_scores`
    windows : figures in windows of about 30 s, see `window_scores`
    withheld : predictions without a sensor, see `withheld_scores`
    smoothed : velocity against the smoothed one, see `smoothed_scores`
    samples : the scored samples, see `sample_scores`
    summary : what was scored of the flight, and how each set fared
    """

    metrics: pa.Table
    blocks: pa.Table
    windows: pa.Table
    withheld: pa.Table
    smoothed: pa.Table
    samples: pa.Table
    summary: dict[str, Any]

    def figure(self, set_name: str, source: str, axis: str, metric: str) -> float:
        """One figure of a set (docs/metrics.md names them).

        Raises
        ------
        KeyError
            There is none: `summary` says why a set or the flight is not scored.
        """
        wanted = {"set": set_name, "source": source, "axis": axis, "metric": metric}
        columns = {name: self.metrics[name].to_pylist() for name in wanted}
        for row, names in enumerate(zip(*columns.values(), strict=True)):
            if names == tuple(wanted.values()):
                return float(self.metrics["value"][row].as_py())
        raise KeyError(tuple(wanted.values()))


def scored_flight(
    flight: Flight, settings: ScoringSettings | None = None, onboard: Mapping[SourceAxis, AxisSamples] | None = None
) -> ScoredFlight:
    """What scores need of a flight.

    Parameters
    ----------
    flight : canonical, with `SCORE_TOPICS`
    onboard : innovations that the vehicle logged; by default they are looked up in the log, which keeps it in memory
    """
    settings = settings or ScoringSettings()
    log_gaps = imu_gaps(flight, settings.log_gap_s)
    asked = {*SCORE_TOPICS} - {*IMU_TOPICS, *INNOVATION_TOPICS}
    rest = {key: table for key, table in flight.topics.items() if key[0] in asked}
    return ScoredFlight(flight.with_topics(rest), log_gaps, onboard_samples(flight) if onboard is None else onboard)


def score_sets(
    scored: ScoredFlight,
    replays: Iterable[ReplayedSet],
    *,
    present: str = PRESENT,
    settings: ScoringSettings | None = None,
) -> FlightScores:
    """Score every parameter set of one flight.

    The window, the samples, the gaps and the limits beyond which errors are clipped are those of the present set; what
    another set lacks of them costs it alone.

    Parameters
    ----------
    replays : of all sets, the present one among them; the others with at least what `Yardstick.recording` says
    present : the set that flies now; the others are compared with it
    """
    records = sorted(replays, key=lambda record: record.name != present)
    antenna = next((one for one in records if one.name in WITH_MEASURED_ANTENNA), None)
    yardstick = Yardstick(scored, records[0], settings, antenna)
    return joined_scores(score_flight(yardstick), {record.name: score_set(yardstick, record) for record in records})


def joined_scores(flight: SetScores, sets: Mapping[str, SetScores]) -> FlightScores:
    """The scores of a flight out of those of its sets, in their order; the flight's own figures come last."""
    return FlightScores(
        metrics=pa.concat_tables([*(one.metrics for one in sets.values()), flight.metrics]),
        blocks=pa.concat_tables([one.blocks for one in sets.values()]),
        windows=pa.concat_tables([one.windows for one in sets.values()]),
        withheld=pa.concat_tables([one.withheld for one in sets.values()]),
        smoothed=pa.concat_tables([one.smoothed for one in sets.values()]),
        samples=pa.concat_tables([one.samples for one in sets.values()]).unify_dictionaries(),
        summary=joined_summary(flight, {name: one.summary for name, one in sets.items()}),
    )


def joined_summary(flight: SetScores, sets: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """What `scoring.json` holds."""
    return flight.summary | {"sets": dict(sets)}
