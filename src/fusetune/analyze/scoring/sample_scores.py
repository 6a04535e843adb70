"""Figures that are made of the samples of one set: per sample, block and window."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.scoring.block_scores import BLOCK_SCHEMA, block_rows
from fusetune.analyze.scoring.charges import EvidenceCost
from fusetune.analyze.scoring.measurement_alignment import (
    AxesTogether,
    Counted,
    CountedSamples,
    Masks,
    axes_together,
    counted_samples,
    own_samples,
    sample_mask,
    sample_masks,
)
from fusetune.analyze.scoring.metrics_table import MetricsTable, add_all_innovation_metrics
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.analyze.scoring.window_scores import (
    add_worst_windows,
    window_edges,
    window_figures,
    window_rows,
)
from fusetune.px4.aid_sources import MEASURED_SOURCES
from fusetune.set_names import ONBOARD

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
    """Rows of `scores.parquet`, `windows.parquet` and `samples.parquet`, and what the set cost itself, by source and
    axis."""

    blocks: pa.Table
    windows: pa.Table
    samples: pa.Table
    costs: Mapping[SourceAxis, EvidenceCost]


def counted(
    record: ReplayedSet, masks: Masks, window: ScoringWindow, max_lacking_percent: float
) -> dict[SourceAxis, Counted]:
    """Samples of a set at the masks, and of sources that these do not have at the set's own measurements."""
    found: dict[SourceAxis, Counted] = {}
    for source in MEASURED_SOURCES.values():
        for axis in range(source.axes):
            key = source.name, axis
            if key in masks:
                found[key] = counted_samples(masks[key], record, window, max_lacking_percent)
            elif key in record.first_fused and (own := sample_mask(record, key, window)) is not None:
                found[key] = Counted(_whole(own.time.size), own_samples(own, record.samples[key]))
    return found


def counted_of_its_own(record: ReplayedSet, masks: Masks) -> dict[SourceAxis, Counted]:
    """Samples of the set that the masks are of."""
    return {key: Counted(_whole(mask.time.size), own_samples(mask, record.samples[key])) for key, mask in masks.items()}


def _whole(count: int) -> EvidenceCost:
    return EvidenceCost(count, 0, 0)


def score_samples(
    table: MetricsTable,
    set_name: str,
    found: Mapping[SourceAxis, Counted],
    masks: Masks,
    window: ScoringWindow,
    settings: ScoringSettings,
) -> SampleScores:
    """Append the figures of every source and axis, and of their groups; sums of blocks and windows.

    Sources that the present set does not fuse have figures, but no blocks: on them no set can be compared with it.

    Parameters
    ----------
    found : the set's samples
    masks : of the present set
    """
    edges, wide_edges = window.block_edges(settings.block_s), window_edges(window, settings.window_s)
    blocks, windows = [], []
    samples = [one.samples for one in found.values() if one.samples is not None]
    for together in axes_together(samples):
        add_all_innovation_metrics(table, set_name, together, settings.confidence)
        compared = tuple(one for one in together.samples if masks.get((one.mask.source, one.mask.axis)) is one.mask)
        if compared:
            blocks.append(block_rows(table.flight, set_name, AxesTogether(together.source, compared), edges))
        for figures in window_figures(together, wide_edges):
            add_worst_windows(table, set_name, figures)
            windows.append(figures)
    return SampleScores(
        pa.concat_tables(blocks) if blocks else BLOCK_SCHEMA.empty_table(),
        window_rows(table.flight, set_name, windows, wide_edges),
        # of what is sampled at every update the samples would fill the disk, and no plot shows them
        _sample_rows(set_name, [one for one in samples if not MEASURED_SOURCES[one.mask.source].every_update]),
        {key: found[key].cost for key in masks},
    )


def _sample_rows(set_name: str, samples: list[CountedSamples]) -> pa.Table:
    """Rows of `samples.parquet` of one set."""
    counts = [one.mask.time.size for one in samples]
    names = list(dict.fromkeys(one.mask.source for one in samples))
    number = np.array([names.index(one.mask.source) for one in samples], np.int32)

    def joined(name: str) -> pa.Array:
        return pa.array(
            np.concatenate(
                [np.zeros(0, np.float32), *(getattr(one, name) for one in samples)],
                dtype=np.float32,
                casting="same_kind",
            )
        )

    return pa.table(
        {
            "set": pa.DictionaryArray.from_arrays(
                pa.array(np.zeros(sum(counts), np.int32)), pa.array([set_name], pa.string())
            ),
            "source": pa.DictionaryArray.from_arrays(pa.array(np.repeat(number, counts)), pa.array(names, pa.string())),
            "axis": pa.array(np.repeat(np.array([one.mask.axis for one in samples], np.int8), counts)),
            "time_us": pa.array(np.concatenate([np.zeros(0, np.int64), *(one.mask.time for one in samples)])),
            **{name: joined(name) for name in ("innovation", "innovation_variance", "test_ratio")},
            "winsor_limit": pa.array(
                np.repeat(np.array([one.mask.winsor_limit for one in samples], np.float64), counts)
            ),
        },
        schema=SAMPLES_SCHEMA,
    )


def add_onboard(
    table: MetricsTable,
    onboard: Mapping[SourceAxis, AxisSamples],
    window: ScoringWindow,
    settings: ScoringSettings,
    parameters: dict[str, float],
) -> None:
    """Append the vehicle's own figures, on the same part of the flight but at the times that it logged."""
    record = ReplayedSet(ONBOARD, parameters, {}, {}, onboard, {}, {})
    found = counted_of_its_own(record, sample_masks(record, window))
    for together in axes_together([one.samples for one in found.values() if one.samples is not None]):
        add_all_innovation_metrics(table, ONBOARD, together, settings.confidence)
