"""The scores of one set on a flight, measured with its yardstick; nothing here is written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.flight.excitation import excitation
from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet
from fusetune.analyze.scoring.block_scores import BLOCK_SCHEMA, block_rows
from fusetune.analyze.scoring.columns import parted
from fusetune.analyze.scoring.filter_events import FilterEvents, filter_events
from fusetune.analyze.scoring.ground_metrics import add_ground_events, add_ground_metrics
from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.analyze.scoring.metrics_table import (
    MetricsTable,
    add_events,
    add_told_noise,
    add_true_errors,
    add_whiteness,
    finished_tables,
)
from fusetune.analyze.scoring.reset_jumps import Jumps, reset_jumps
from fusetune.analyze.scoring.sample_scores import (
    SAMPLES_SCHEMA,
    SampleScores,
    add_onboard,
    counted,
    counted_of_its_own,
    sample_rows,
    score_samples,
)
from fusetune.analyze.scoring.scoring_summary import flight_summary, set_summary
from fusetune.analyze.scoring.set_evidence import set_evidence
from fusetune.analyze.scoring.smoothed_scores import SMOOTHED_SCHEMA, smoothed_rows, velocity_differences
from fusetune.analyze.scoring.true_errors import true_errors
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.analyze.scoring.window_scores import WINDOW_SCHEMA, window_edges, window_rows
from fusetune.analyze.scoring.withheld_scores import (
    WITHHELD_SCHEMA,
    CountedGaps,
    add_true_drift,
    add_withheld_metrics,
    counted_gaps,
    own_gaps,
    withheld_rows,
)
from fusetune.analyze.scoring.yardstick import Yardstick
from fusetune.analyze.sensors.source_whiteness import source_whiteness
from fusetune.analyze.sensors.told_noise import told_noises
from fusetune.set_names import DELAY_MENDED
from fusetune.storage.freed_memory import give_back_freed_memory

TABLES = {
    "metrics": METRICS_SCHEMA,
    "blocks": BLOCK_SCHEMA,
    "windows": WINDOW_SCHEMA,
    "withheld": WITHHELD_SCHEMA,
    "smoothed": SMOOTHED_SCHEMA,
    "samples": SAMPLES_SCHEMA,
}
"""The tables that the scores of a set have rows of, by the names that they have in `SetScores`."""


@dataclass(frozen=True)
class SetScores:
    """Scores of one set on a flight.

    Attributes
    ----------
    metrics : all figures, see `fusetune.analyze.scoring.metrics_schema`
    blocks : sums over blocks of about 10 s, which the decision draws from, see `block_scores`
    windows : figures in windows of about 30 s, see `window_scores`
    withheld : predictions without a sensor, see `withheld_scores`
    smoothed : velocity against the smoothed one, see `smoothed_scores`
    samples : the scored samples, see `sample_scores`
    summary : how the set fared, its part of `scoring.json`
    """

    metrics: pa.Table
    blocks: pa.Table
    windows: pa.Table
    withheld: pa.Table
    smoothed: pa.Table
    samples: pa.Table
    summary: dict[str, Any]


def score_flight(yardstick: Yardstick) -> SetScores:
    """What is told of the flight beside the sets: the figures that the vehicle logged, as of a set, and the summary of
    the flight."""
    flight, window, present = yardstick.flight, yardstick.window, yardstick.present
    table = MetricsTable(flight.name)
    summary = flight_summary(flight, present.name, window, yardstick.whiteness, yardstick.settings)
    moved, smoothed = None, None
    if window.intervals:
        add_onboard(table, yardstick.scored.onboard, window, yardstick.settings, present.parameters)
        states = yardstick.states
        moved = excitation(states.time, states.velocity, states.quaternion, window.intervals)
        # to smooth the velocity takes as much again
        del states
        smoothed = yardstick.smoothed
    summary["excitation"] = None if moved is None else moved.document()
    summary["smoothed_reference"] = None if smoothed is None else smoothed.reference.document
    return _figures_alone(table, summary)


def score_set(yardstick: Yardstick, record: ReplayedSet) -> SetScores:
    """Score a set.

    What it lacks of the present set's measurements and gaps costs it alone, see `fusetune.analyze.scoring.charges`.

    Parameters
    ----------
    record : replay with at least what `Yardstick.recording` says
    """
    (scores,) = score_together(yardstick, [record])
    return scores


def score_together(yardstick: Yardstick, records: Sequence[ReplayedSet]) -> list[SetScores]:
    """Score several sets, each as if it were alone: where samples are few, several take little longer than one.

    Parameters
    ----------
    records : of different names
    """
    sets = [_begun(yardstick, record) for record in records]
    _add_ground(yardstick, [one for one in sets if one.is_whole])
    for one in sets:
        events = filter_events(one.record, yardstick.ground.intervals, one.jumps)
        add_ground_events(one.table, one.name, events, yardstick.ground)
    compared = [one for one in sets if one.is_whole and one.window.intervals]
    _add_samples(yardstick, compared)
    for one in compared:
        one.gaps = _gaps(yardstick, one.record, one.window)
        add_withheld_metrics(one.table, one.name, one.gaps)
    if len(sets) == 1:
        # of a long flight the samples' arrays and those of the states are about as large
        give_back_freed_memory()
    for one in compared:
        one.differences = _add_state_figures(one.table, yardstick, one.record, one.window)
    rows = {name: [schema.empty_table()] * len(sets) for name, schema in TABLES.items()}
    rows["metrics"] = [*parted(finished_tables([one.table for one in sets]), [len(one.table) for one in sets])]
    for name, tables in (_rows_of(yardstick, compared) if compared else {}).items():
        for one, table in zip(compared, tables, strict=True):
            rows[name][sets.index(one)] = table
    return [
        SetScores(**{name: tables[place] for name, tables in rows.items()}, summary=_summary(yardstick, one))
        for place, one in enumerate(sets)
    ]


@dataclass(eq=False)
class _Scored:
    """A set on the way to its scores; `window` is as it sees it."""

    record: ReplayedSet
    window: ScoringWindow
    table: MetricsTable
    jumps: Mapping[str, Jumps]
    events: FilterEvents
    samples: SampleScores = field(default_factory=SampleScores)
    gaps: list[CountedGaps] = field(default_factory=list)
    differences: npt.NDArray[np.float64] | None = None

    @property
    def name(self) -> str:
        return self.record.name

    @property
    def is_whole(self) -> bool:
        """Whether it is not left out."""
        return self.name not in self.window.excluded


def _begun(yardstick: Yardstick, record: ReplayedSet) -> _Scored:
    table, jumps = MetricsTable(yardstick.flight.name), reset_jumps(record)
    events = filter_events(record, yardstick.flying(record), jumps)
    add_events(table, record.name, events)
    return _Scored(record, yardstick.window_of(record), table, jumps, events)


def _summary(yardstick: Yardstick, one: _Scored) -> dict[str, Any]:
    summary = set_summary(one.record, yardstick.present, one.window, one.events, yardstick.flight)
    resets_s, most = one.window.own_resets_s(one.name), yardstick.settings.max_lacking_percent
    return summary | {"evidence": set_evidence(one.samples.costs, one.gaps, resets_s, most)}


def _rows_of(yardstick: Yardstick, sets: Sequence[_Scored]) -> dict[str, Iterable[pa.Table]]:
    """Rows of the tables beside the metrics, of each set."""
    flight, edges = yardstick.flight.name, yardstick.block_edges
    windows = window_edges(yardstick.window, yardstick.settings.window_s)
    found: dict[str, Iterable[pa.Table]] = {
        "blocks": block_rows(flight, {one.name: one.samples.blocks for one in sets}),
        "windows": window_rows(flight, {one.name: one.samples.windows for one in sets}, windows),
        "withheld": withheld_rows(flight, {one.name: one.gaps for one in sets}, edges),
        "samples": [sample_rows(one.name, one.samples.samples) for one in sets],
    }
    if yardstick.smoothed is not None:
        differences = {one.name: one.differences for one in sets if one.differences is not None}
        found["smoothed"] = smoothed_rows(flight, differences, yardstick.smoothed, edges)
    return found


def _figures_alone(table: MetricsTable, summary: dict[str, Any]) -> SetScores:
    nothing = {name: schema.empty_table() for name, schema in TABLES.items()}
    return SetScores(**(nothing | {"metrics": table.finished()}), summary=summary)


def _add_ground(yardstick: Yardstick, sets: Sequence[_Scored]) -> None:
    if not yardstick.ground.intervals:
        return
    masks, settings = yardstick.ground_masks, yardstick.settings
    sources = [
        counted_of_its_own(one.record, masks)
        if one.record is yardstick.present
        else counted(one.record, masks, yardstick.ground.of_set(one.record, settings), settings.max_lacking_percent)
        for one in sets
    ]
    add_ground_metrics({one.name: one.table for one in sets}, sources, settings)


def _add_samples(yardstick: Yardstick, sets: Sequence[_Scored]) -> None:
    if not sets:
        return
    masks, settings = yardstick.masks, yardstick.settings
    sources = [
        counted_of_its_own(one.record, masks)
        if one.record is yardstick.present
        else counted(one.record, masks, one.window, settings.max_lacking_percent)
        for one in sets
    ]
    found = score_samples({one.name: one.table for one in sets}, sources, masks, yardstick.window, settings)
    for one, samples in zip(sets, found, strict=True):
        one.samples = samples


def _gaps(yardstick: Yardstick, record: ReplayedSet, window: ScoringWindow) -> list[CountedGaps]:
    if record is yardstick.present:
        return own_gaps(yardstick.gaps)
    return counted_gaps(yardstick.gaps, record, window, yardstick.settings.max_lacking_percent)


def _add_state_figures(
    table: MetricsTable, yardstick: Yardstick, record: ReplayedSet, window: ScoringWindow
) -> npt.NDArray[np.float64] | None:
    """Append what takes the states of the replay; the differences to the smoothed velocity, where there is one."""
    is_present = record is yardstick.present
    states = yardstick.states if is_present else record.states()
    _add_source_figures(table, yardstick, record, states)
    for reference in yardstick.known_references:
        truth = reference.truth
        # what a set is fed with is no reference for it
        if truth.kind == "vision" and any(source.startswith("ev_") for source in record.fused_sources):
            continue
        figures = true_errors(record, states, reference, window, yardstick.settings.confidence)
        add_true_errors(table, record.name, figures, truth.kind)
        if truth.kind == "truth":
            add_true_drift(table, record, truth, window)
    mask = yardstick.smoothed
    if mask is None:
        return None
    return mask.present if is_present else velocity_differences(mask.reference, states)


def _add_source_figures(table: MetricsTable, yardstick: Yardstick, record: ReplayedSet, states: FilterStates) -> None:
    """Append what is told of the sources themselves: as the present set sees them, and with delays mended, for the
    error of a source with a wrong delay holds the acceleration."""
    intervals = yardstick.window.intervals
    if record is yardstick.present:
        add_whiteness(table, record.name, yardstick.whiteness)
        add_told_noise(table, record.name, told_noises(record, intervals))
    elif record.name == DELAY_MENDED:
        add_whiteness(table, record.name, source_whiteness(record, states, yardstick.flight, intervals))
