"""The scores of the parameter sets of one flight, all on the same samples; nothing here is written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from fusetune.analyze.flight.excitation import Excitation, excitation
from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.flight.phases import IMU_TOPICS, airborne_intervals, imu_gaps
from fusetune.analyze.flight.reference_truth import TRUTH_TOPICS, Truth, read_references
from fusetune.analyze.replaying.onboard import INNOVATION_TOPICS, onboard_samples
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.scoring.filter_events import filter_events
from fusetune.analyze.scoring.ground_metrics import add_ground_events, add_ground_metrics, ground_window
from fusetune.analyze.scoring.metrics_table import (
    MetricsTable,
    add_events,
    add_told_noise,
    add_true_errors,
    add_whiteness,
)
from fusetune.analyze.scoring.sample_scores import add_onboard, no_sample_scores, score_samples
from fusetune.analyze.scoring.scoring_summary import scoring_summary
from fusetune.analyze.scoring.set_evidence import set_evidence
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.smoothed_scores import SMOOTHED_SCHEMA, STEP_US, SmoothedScores
from fusetune.analyze.scoring.true_errors import true_errors
from fusetune.analyze.scoring.window import ScoringWindow, after, end_of_warm_up, scoring_window
from fusetune.analyze.scoring.withheld_scores import (
    add_true_drift,
    add_withheld_metrics,
    paired_gaps,
    withheld_rows,
)
from fusetune.analyze.sensors.source_whiteness import Whiteness, source_whiteness
from fusetune.analyze.sensors.told_noise import told_noises
from fusetune.analyze.smoothing.smoothed_velocity import smoothed_velocity
from fusetune.px4.flight import Flight
from fusetune.set_names import ANTENNA_MENDED, PRESENT, mended_name
from fusetune.storage.files import AnyPath
from fusetune.storage.freed_memory import give_back_freed_memory

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
class ScoredFlight:
    """What scores need of the flight itself, beside the replays.

    Attributes
    ----------
    flight : canonical; of its topics only what nothing else stands for here
    log_gaps : gaps in the IMU samples of the log, µs
    onboard : innovations that the vehicle logged, by source and axis
    """

    flight: Flight
    log_gaps: tuple[Interval, ...]
    onboard: Mapping[SourceAxis, AxisSamples]


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
    summary : what was scored of the flight, and how each set fared
    """

    metrics: pa.Table
    blocks: pa.Table
    windows: pa.Table
    withheld: pa.Table
    smoothed: pa.Table
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
    take_samples: Callable[[pa.Table], None] | None = None,
    spool_folder: AnyPath | None = None,
) -> FlightScores:
    """Score every parameter set of one flight.

    The window, the samples and the gaps are those of the present set; what another set lacks of them costs it alone. Of
    samples one source and axis is looked up at a time, of states one set.

    Parameters
    ----------
    replays : of all sets, the present one among them
    present : the set that flies now; the others are compared with it
    take_samples : is given the scored samples, rows of `sample_scores.SAMPLES_SCHEMA`
    spool_folder : takes nameless files of paired samples; by default they stay in memory
    """
    settings, flight = settings or ScoringSettings(), scored.flight
    records = sorted(replays, key=lambda record: record.name != present)
    airborne = airborne_intervals(flight, records[0].flags)
    window = scoring_window(records, present, airborne, scored.log_gaps, settings)
    phases = {record.name: _flight_after_warm_up(record, records[0], airborne, window, settings) for record in records}
    events = {record.name: filter_events(record, phases[record.name]) for record in records}

    table = MetricsTable(flight.name)
    for name, event in events.items():
        add_events(table, name, event)
    log = flight.start_timestamp, flight.last_timestamp
    ground = ground_window(records, present, airborne, log, scored.log_gaps, window, settings)
    add_ground_metrics(table, records, present, ground, settings)
    for record in records:
        add_ground_events(table, record.name, filter_events(record, ground.intervals), ground)
    samples, gaps = no_sample_scores(), []
    whiteness: dict[SourceAxis, Whiteness] = {}
    smoothed, reference, moved = SMOOTHED_SCHEMA.empty_table(), None, None
    if window.intervals:
        kept = [record for record in records if record.name not in window.excluded]
        samples = score_samples(table, kept, present, window, settings, take_samples, spool_folder)
        # Replays from elsewhere, such as PX4's own estimator, come without gaps.
        has_gaps = all(record.withheld is not None for record in kept)
        gaps = paired_gaps(kept, present, window, settings) if has_gaps else []
        add_withheld_metrics(table, gaps)
        add_onboard(table, scored.onboard, window, settings, records[0].parameters)
        fused = {source for record in records for source in record.fused_sources}
        references = read_references(flight, fused, records[0].parameters)
        reference = smoothed_velocity(_with_measured_antenna(kept), flight, window.intervals, STEP_US)
        differences = SmoothedScores(reference)
        whiteness, moved = _add_state_figures(table, kept, flight, references, window, settings, differences)
        smoothed = differences.rows(flight.name, window.block_edges(settings.block_s))
        for truth in references:
            if truth.kind == "truth" and has_gaps:
                add_true_drift(table, kept, truth, window)
    edges = window.block_edges(settings.block_s) if gaps else np.zeros(0, np.int64)
    withheld = withheld_rows(flight.name, gaps, edges)
    evidence = set_evidence([record.name for record in records], window, samples.costs, gaps, settings)
    summary = scoring_summary(flight, records, present, window, events, evidence, whiteness, settings)
    summary["excitation"] = None if moved is None else moved.document()
    summary["smoothed_reference"] = None if reference is None else reference.document
    return FlightScores(table.finished(), samples.blocks, samples.windows, withheld, smoothed, summary)


def _with_measured_antenna(kept: Sequence[ReplayedSet]) -> ReplayedSet:
    """The replay that the smoothed velocity is made of: the present one, or the one with the antenna as measured.

    The measured velocities are those of the antenna, less what the told place makes of them. Made with a wrong place,
    the reference has the present set's error, and a set that mends it would seem to be farther off the truth.
    """
    names = (ANTENNA_MENDED, mended_name(ANTENNA_MENDED))
    return next((one for one in kept if one.name in names), kept[0])


def _flight_after_warm_up(
    record: ReplayedSet,
    present: ReplayedSet,
    airborne: Sequence[Interval],
    window: ScoringWindow,
    settings: ScoringSettings,
) -> tuple[Interval, ...]:
    """Flight time of one set after its own warm-up: before it every filter resets and switches sources."""
    if window.warm_up_end is None:
        return tuple(airborne)
    return after(airborne, end_of_warm_up(record, present, settings))


def _add_state_figures(
    table: MetricsTable,
    records: Sequence[ReplayedSet],
    flight: Flight,
    references: Sequence[Truth],
    window: ScoringWindow,
    settings: ScoringSettings,
    differences: SmoothedScores,
) -> tuple[dict[SourceAxis, Whiteness], Excitation | None]:
    """Append what takes the states of each replay: whiteness of the sources, errors against the references.

    The differences to the smoothed velocity are taken, too.

    Returns
    -------
    The whiteness and the motion as the first of the records, the present set, sees them
    """
    present: dict[SourceAxis, Whiteness] = {}
    moved: Excitation | None = None
    for number, record in enumerate(records):
        states = record.states()
        found = source_whiteness(record, states, flight, window.intervals)
        add_whiteness(table, record.name, found)
        if not number:
            present = found
            moved = excitation(states.time, states.velocity, states.quaternion, window.intervals)
            add_told_noise(table, record.name, told_noises(record, window.intervals))
        for truth in references:
            figures = true_errors(record, states, truth, window, settings.confidence)
            add_true_errors(table, record.name, figures, truth.kind)
        differences.add(record.name, states)
        give_back_freed_memory()
    return present, moved
