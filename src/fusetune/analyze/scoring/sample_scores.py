"""Figures that are made of the samples of one source and axis at a time: per sample, block and window."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples, SampleSpool, SourceAxis
from fusetune.analyze.scoring.block_scores import BLOCK_SCHEMA, block_rows
from fusetune.analyze.scoring.charges import EvidenceCost
from fusetune.analyze.scoring.measurement_alignment import PairedSamples, SamplesOfSet, paired_samples
from fusetune.analyze.scoring.metrics_table import (
    FEWEST_SAMPLES,
    MetricsTable,
    add_axis_metrics,
    add_group_metrics,
    groups_of,
)
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.analyze.scoring.window_scores import (
    WINDOW_SCHEMA,
    add_worst_windows,
    window_edges,
    window_figures,
    window_rows,
)
from fusetune.px4.aid_sources import AXES, MEASURED_SOURCES
from fusetune.set_names import ONBOARD
from fusetune.storage.files import AnyPath
from fusetune.storage.freed_memory import give_back_freed_memory

SAMPLES_SCHEMA = pa.schema(
    [
        pa.field("set", pa.dictionary(pa.int32(), pa.string())),
        pa.field("source", pa.dictionary(pa.int32(), pa.string())),
        pa.field("axis", pa.int8()),
        pa.field("time_us", pa.int64()),
        pa.field("innovation", pa.float32()),
        pa.field("innovation_variance", pa.float32()),
        pa.field("test_ratio", pa.float32()),
        pa.field("winsor_limit", pa.float64()),
    ]
)
"""One row per set and measurement; `winsor_limit` is the limit beyond which the innovations of all sets count as it."""


class SampleScores(NamedTuple):
    """Rows of `scores.parquet` and of `windows.parquet`, and what each set cost itself, by source and axis."""

    blocks: pa.Table
    windows: pa.Table
    costs: Mapping[SourceAxis, Mapping[str, EvidenceCost]]


def no_sample_scores() -> SampleScores:
    """Of a flight of which nothing is scored; made when asked for, as PyArrow's first table looks for pandas."""
    return SampleScores(BLOCK_SCHEMA.empty_table(), WINDOW_SCHEMA.empty_table(), {})


def score_samples(
    table: MetricsTable,
    records: Sequence[ReplayedSet],
    present: str,
    window: ScoringWindow,
    settings: ScoringSettings,
    take_samples: Callable[[pa.Table], None] | None = None,
    spool_folder: AnyPath | None = None,
) -> SampleScores:
    """Append the figures of every source and axis, and of their groups; sums of blocks and windows.

    Sources that the present set does not fuse have figures, but no blocks: on them no set can be compared with it.

    Parameters
    ----------
    records : replays of the sets that are scored
    take_samples, spool_folder : as for `score_sets`
    """
    edges, wide_edges = window.block_edges(settings.block_s), window_edges(window, settings.window_s)
    blocks, windows = [], []
    costs: dict[SourceAxis, Mapping[str, EvidenceCost]] = {}
    for source in MEASURED_SOURCES.values():
        pairs: dict[int, PairedSamples] = {}
        spool = SampleSpool(spool_folder)
        for axis in range(source.axes):
            found = paired_samples(records, (source.name, axis), present, window, spool, settings)
            if found is not None:
                pairs[axis] = found
        for one in pairs.values():
            add_axis_metrics(table, one, settings)
            if one.sets[0] == present:
                blocks.append(block_rows(table.flight, one, edges))
                costs[source.name, one.axis] = one.costs
            # of what is sampled at every update the samples would fill the disk, and no plot shows them
            if take_samples is not None and not source.every_update:
                for of_set in one.each():
                    take_samples(_sample_rows(of_set, one.winsor_limit))
        if pairs:
            add_group_metrics(table, pairs, settings)
        single = [(AXES[axis], [one]) for axis, one in pairs.items() if one.time.size >= FEWEST_SAMPLES]
        for axis_name, members in (*single, *groups_of(pairs)):
            figures = window_figures(members, axis_name, wide_edges)
            add_worst_windows(table, figures)
            windows.append(window_rows(table.flight, figures, wide_edges))
        give_back_freed_memory()
    return SampleScores(
        pa.concat_tables(blocks) if blocks else BLOCK_SCHEMA.empty_table(),
        pa.concat_tables(windows) if windows else WINDOW_SCHEMA.empty_table(),
        costs,
    )


def _sample_rows(pairs: SamplesOfSet, winsor_limit: float) -> pa.Table:
    """Rows of `samples.parquet` of one set."""
    n = pairs.time.size

    def repeated(name: str) -> pa.Array:
        return pa.DictionaryArray.from_arrays(pa.array(np.zeros(n, np.int32)), pa.array([name], pa.string()))

    columns = {
        "set": repeated(pairs.sets[0]),
        "source": repeated(pairs.source),
        "axis": pa.array(np.full(n, pairs.axis, dtype=np.int8)),
        "time_us": pa.array(pairs.time),
    }
    for name in ("innovation", "innovation_variance", "test_ratio"):
        columns[name] = pa.array(getattr(pairs, name)[0].astype(np.float32))
    columns["winsor_limit"] = pa.array(np.full(n, winsor_limit))
    return pa.table(columns, schema=SAMPLES_SCHEMA)


def add_onboard(
    table: MetricsTable,
    onboard: Mapping[SourceAxis, AxisSamples],
    window: ScoringWindow,
    settings: ScoringSettings,
    parameters: dict[str, float],
) -> None:
    """Append the vehicle's own figures, on the same part of the flight but at the times that it logged."""
    record = ReplayedSet(ONBOARD, parameters, {}, {}, onboard, {}, {})
    for source in MEASURED_SOURCES.values():
        pairs = {}
        for axis in range(source.axes):
            found = paired_samples([record], (source.name, axis), ONBOARD, window)
            if found is not None:
                pairs[axis] = found
                add_axis_metrics(table, found, settings)
        if pairs:
            add_group_metrics(table, pairs, settings)
