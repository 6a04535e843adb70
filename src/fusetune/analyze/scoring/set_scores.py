"""The scores of one set on a flight, measured with its yardstick; nothing here is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from fusetune.analyze.flight.excitation import excitation
from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet
from fusetune.analyze.replaying.samples import SourceAxis
from fusetune.analyze.scoring.block_scores import BLOCK_SCHEMA
from fusetune.analyze.scoring.charges import EvidenceCost
from fusetune.analyze.scoring.filter_events import filter_events
from fusetune.analyze.scoring.ground_metrics import add_ground_events, add_ground_metrics
from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.analyze.scoring.metrics_table import (
    MetricsTable,
    add_events,
    add_told_noise,
    add_true_errors,
    add_whiteness,
)
from fusetune.analyze.scoring.reset_jumps import Jumps, reset_jumps
from fusetune.analyze.scoring.sample_scores import (
    SAMPLES_SCHEMA,
    SampleScores,
    add_onboard,
    counted,
    counted_of_its_own,
    score_samples,
)
from fusetune.analyze.scoring.scoring_summary import flight_summary, set_summary
from fusetune.analyze.scoring.set_evidence import set_evidence
from fusetune.analyze.scoring.smoothed_scores import SMOOTHED_SCHEMA, smoothed_rows, velocity_differences
from fusetune.analyze.scoring.true_errors import true_errors
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.analyze.scoring.window_scores import WINDOW_SCHEMA
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
    window, flight = yardstick.window_of(record), yardstick.flight
    table = MetricsTable(flight.name)
    jumps = reset_jumps(record)
    events = filter_events(record, yardstick.flying(record), jumps)
    add_events(table, record.name, events)
    _add_ground(table, yardstick, record, jumps, excluded=record.name in window.excluded)
    summary = set_summary(record, yardstick.present, window, events, flight)
    if not window.intervals or record.name in window.excluded:
        return _figures_alone(table, summary | {"evidence": _evidence(yardstick, window, record, {}, [])})
    found = _of_samples(table, yardstick, record, window)
    gaps = _gaps(yardstick, record, window)
    add_withheld_metrics(table, record.name, gaps)
    # of a long flight the samples' arrays and those of the states are about as large
    give_back_freed_memory()
    smoothed = _add_state_figures(table, yardstick, record, window)
    return SetScores(
        table.finished(),
        found.blocks,
        found.windows,
        withheld_rows(flight.name, record.name, gaps, yardstick.block_edges),
        smoothed,
        found.samples,
        summary | {"evidence": _evidence(yardstick, window, record, found.costs, gaps)},
    )


def _figures_alone(table: MetricsTable, summary: dict[str, Any]) -> SetScores:
    """Of a set that is left out, or on a flight of which nothing is scored."""
    nothing = {name: schema.empty_table() for name, schema in TABLES.items()}
    return SetScores(**(nothing | {"metrics": table.finished()}), summary=summary)


def _evidence(
    yardstick: Yardstick,
    window: ScoringWindow,
    record: ReplayedSet,
    samples: Mapping[SourceAxis, EvidenceCost],
    gaps: list[CountedGaps],
) -> dict[str, Any]:
    return set_evidence(samples, gaps, window.own_resets_s(record.name), yardstick.settings.max_lacking_percent)


def _add_ground(
    table: MetricsTable, yardstick: Yardstick, record: ReplayedSet, jumps: Mapping[str, Jumps], *, excluded: bool
) -> None:
    ground, settings = yardstick.ground, yardstick.settings
    if ground.intervals and not excluded:
        masks = yardstick.ground_masks
        if record is yardstick.present:
            sources = counted_of_its_own(record, masks)
        else:
            sources = counted(record, masks, ground.of_set(record, settings), settings.max_lacking_percent)
        add_ground_metrics(table, record.name, sources, settings)
    add_ground_events(table, record.name, filter_events(record, ground.intervals, jumps), ground)


def _of_samples(table: MetricsTable, yardstick: Yardstick, record: ReplayedSet, window: ScoringWindow) -> SampleScores:
    masks, settings = yardstick.masks, yardstick.settings
    if record is yardstick.present:
        sources = counted_of_its_own(record, masks)
    else:
        sources = counted(record, masks, window, settings.max_lacking_percent)
    return score_samples(table, record.name, sources, masks, window, settings)


def _gaps(yardstick: Yardstick, record: ReplayedSet, window: ScoringWindow) -> list[CountedGaps]:
    if record is yardstick.present:
        return own_gaps(yardstick.gaps)
    return counted_gaps(yardstick.gaps, record, window, yardstick.settings.max_lacking_percent)


def _add_state_figures(
    table: MetricsTable, yardstick: Yardstick, record: ReplayedSet, window: ScoringWindow
) -> pa.Table:
    """Append what takes the states of the replay; rows of the differences to the smoothed velocity."""
    is_present = record is yardstick.present
    states = yardstick.states if is_present else record.states()
    _add_source_figures(table, yardstick, record, states)
    for truth in yardstick.references:
        # what a set is fed with is no reference for it
        if truth.kind == "vision" and any(source.startswith("ev_") for source in record.fused_sources):
            continue
        figures = true_errors(record, states, truth, window, yardstick.settings.confidence)
        add_true_errors(table, record.name, figures, truth.kind)
        if truth.kind == "truth":
            add_true_drift(table, record, truth, window)
    mask = yardstick.smoothed
    if mask is None:
        return SMOOTHED_SCHEMA.empty_table()
    differences = mask.present if is_present else velocity_differences(mask.reference, states)
    return smoothed_rows(yardstick.flight.name, record.name, mask, differences, yardstick.block_edges)


def _add_source_figures(table: MetricsTable, yardstick: Yardstick, record: ReplayedSet, states: FilterStates) -> None:
    """Append what is told of the sources themselves: as the present set sees them, and with delays mended, for the
    error of a source with a wrong delay holds the acceleration."""
    intervals = yardstick.window.intervals
    if record is yardstick.present:
        add_whiteness(table, record.name, yardstick.whiteness)
        add_told_noise(table, record.name, told_noises(record, intervals))
    elif record.name == DELAY_MENDED:
        add_whiteness(table, record.name, source_whiteness(record, states, yardstick.flight, intervals))
