"""Figures that are made of the samples of one set: per sample, block and window."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa

from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.scoring.block_scores import BlockSums, block_sums
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
    sets_together,
    source_masks,
)
from fusetune.analyze.scoring.metrics_table import MetricsTable, add_innovation_metrics
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.analyze.scoring.window_scores import (
    WindowFigures,
    add_worst_windows,
    window_edges,
    window_figures,
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


@dataclass
class SampleScores:
    """What is made of the samples of one set; `costs` is what it cost itself, by source and axis."""

    blocks: list[BlockSums] = field(default_factory=list)
    windows: list[WindowFigures] = field(default_factory=list)
    samples: list[CountedSamples] = field(default_factory=list)
    costs: dict[SourceAxis, EvidenceCost] = field(default_factory=dict)


OfSource = Mapping[SourceAxis, Counted]
"""Samples of the axes of one source."""


def counted(record: ReplayedSet, masks: Masks, window: ScoringWindow, max_lacking_percent: float) -> Iterator[OfSource]:
    """Samples of a set at the masks, and of sources that these do not have at the set's own measurements.

    One of `MEASURED_SOURCES` comes after the other, with what there is of it, so that those of an hour's flight are not
    in memory at once.
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
        yield found


def counted_of_its_own(record: ReplayedSet, masks: Masks) -> Iterator[OfSource]:
    """Samples of the set that the masks are of, one of `MEASURED_SOURCES` after the other."""
    for source in MEASURED_SOURCES:
        yield {key: _own(mask, record) for key, mask in masks.items() if key[0] == source}


def _own(mask: SampleMask, record: ReplayedSet) -> Counted:
    return Counted(EvidenceCost(mask.time.size, 0, 0), own_samples(mask, record.samples[mask.source, mask.axis]))


def score_samples(
    tables: Mapping[str, MetricsTable],
    sources: Sequence[Iterable[OfSource]],
    masks: Masks,
    window: ScoringWindow,
    settings: ScoringSettings,
) -> list[SampleScores]:
    """Append the figures of every source and axis, and of their groups; sums of blocks and windows of each set.

    Sources that the present set does not fuse have figures, but no blocks: on them no set can be compared with it.

    Parameters
    ----------
    tables : of each of the sets, by name
    sources : the samples of each set, source by source
    masks : of the present set
    """
    edges, wide_edges = window.block_edges(settings.block_s), window_edges(window, settings.window_s)
    names, scores = [*tables], [SampleScores() for _ in tables]
    for found in zip(*sources, strict=True):
        for own, one in zip(scores, found, strict=True):
            own.costs |= {key: counted.cost for key, counted in one.items() if key in masks}
        for places, together in sets_together([one.values() for one in found], settings.confidence):
            alike = {names[place]: tables[names[place]] for place in places}
            of_sets = [scores[place] for place in places]
            add_innovation_metrics(alike, together)
            compared = together.of_masks(masks)
            if compared is not None:
                for own, sums in zip(of_sets, block_sums(compared, edges), strict=True):
                    own.blocks.append(sums)
            for figures in window_figures(together, wide_edges):
                add_worst_windows(alike, figures)
                for own, of_set in zip(of_sets, figures.of_sets(), strict=True):
                    own.windows.append(of_set)
            # of what is sampled at every update the samples would fill the disk, and no plot shows them
            if not MEASURED_SOURCES[together.source].every_update:
                for own, samples in zip(of_sets, together.samples_of_sets(), strict=True):
                    own.samples += samples
            is_large = together.time.size > _MANY_SAMPLES
            # with what its figures were made of: the next source's need the room
            del together, compared
            if is_large:
                give_back_freed_memory()
    return scores


def sample_rows(set_name: str, samples: Sequence[CountedSamples]) -> pa.Table:
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
            add_innovation_metrics({ONBOARD: table}, together)
