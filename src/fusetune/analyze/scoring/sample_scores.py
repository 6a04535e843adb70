"""Figures that are made of the samples of one set: per sample, block and window."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.scoring.block_scores import BLOCK_SCHEMA, block_rows
from fusetune.analyze.scoring.charges import EvidenceCost
from fusetune.analyze.scoring.measurement_alignment import (
    Counted,
    CountedSamples,
    Masks,
    SampleMask,
    axes_together,
    counted_samples,
    own_samples,
    sample_masks,
    source_masks,
)
from fusetune.analyze.scoring.metrics_table import MetricsTable, add_innovation_metrics
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
from fusetune.storage.freed_memory import give_back_freed_memory

_MANY_SAMPLES = 300_000
"""Of a source of an hour's flight: the C library keeps arrays of its figures when they are freed."""

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


OfSource = Mapping[SourceAxis, Counted]
"""Samples of the axes of one source."""


def counted(record: ReplayedSet, masks: Masks, window: ScoringWindow, max_lacking_percent: float) -> Iterator[OfSource]:
    """Samples of a set at the masks, and of sources that these do not have at the set's own measurements.

    One source comes after the other, so that those of an hour's flight are not in memory at once.
    """
    for source in MEASURED_SOURCES.values():
        found: dict[SourceAxis, Counted] = {}
        keys = [(source.name, axis) for axis in range(source.axes)]
        is_more = any(key not in masks and key in record.first_fused for key in keys)
        own = source_masks(record, source, window) if is_more else {}
        for key in keys:
            if key in masks:
                found[key] = counted_samples(masks[key], record, window, max_lacking_percent)
            elif key in own:
                found[key] = _own(own[key], record)
        if found:
            yield found


def counted_of_its_own(record: ReplayedSet, masks: Masks) -> Iterator[OfSource]:
    """Samples of the set that the masks are of, one source after the other."""
    for source in dict.fromkeys(source for source, _ in masks):
        yield {key: _own(mask, record) for key, mask in masks.items() if key[0] == source}


def _own(mask: SampleMask, record: ReplayedSet) -> Counted:
    return Counted(EvidenceCost(mask.time.size, 0, 0), own_samples(mask, record.samples[mask.source, mask.axis]))


def score_samples(
    table: MetricsTable,
    set_name: str,
    sources: Iterable[OfSource],
    masks: Masks,
    window: ScoringWindow,
    settings: ScoringSettings,
) -> SampleScores:
    """Append the figures of every source and axis, and of their groups; sums of blocks and windows.

    Sources that the present set does not fuse have figures, but no blocks: on them no set can be compared with it.

    Parameters
    ----------
    sources : the set's samples
    masks : of the present set
    """
    edges, wide_edges = window.block_edges(settings.block_s), window_edges(window, settings.window_s)
    blocks, windows = [], []
    samples: list[CountedSamples] = []
    costs: dict[SourceAxis, EvidenceCost] = {}
    for found in sources:
        costs |= {key: one.cost for key, one in found.items() if key in masks}
        for together in axes_together(found.values(), settings.confidence):
            add_innovation_metrics(table, set_name, together)
            compared = together.of_masks(masks)
            if compared is not None:
                blocks.append(block_rows(table.flight, set_name, compared, edges))
            for figures in window_figures(together, wide_edges):
                add_worst_windows(table, set_name, figures)
                windows.append(figures)
            # of what is sampled at every update the samples would fill the disk, and no plot shows them
            if not MEASURED_SOURCES[together.source].every_update:
                samples += together.samples
            is_large = together.time.size > _MANY_SAMPLES
            # with what its figures were made of: the next source's need the room
            del together, compared
            if is_large:
                give_back_freed_memory()
    return SampleScores(
        pa.concat_tables(blocks) if blocks else BLOCK_SCHEMA.empty_table(),
        window_rows(table.flight, set_name, windows, wide_edges),
        _sample_rows(set_name, samples),
        costs,
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
    for found in counted_of_its_own(record, sample_masks(record, window)):
        for together in axes_together(found.values(), settings.confidence):
            add_innovation_metrics(table, ONBOARD, together)
