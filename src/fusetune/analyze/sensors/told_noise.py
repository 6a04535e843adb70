"""What the estimator is told of each source's noise, to be held against what the data say of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.metrics.metric import SOURCE_UNIT, Metric
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.px4.aid_sources import MEASURED_SOURCES

FEWEST_SAMPLES = 10
"""Fewer tell nothing of a noise."""


@dataclass(frozen=True)
class ToldNoise:
    """One source and axis in the scored part of a flight.

    Attributes
    ----------
    noise : square root of the mean observation variance R, unit of the source
    predicted : square root of the mean variance of the prediction, H P Hᵀ = S − R, unit of the source
    samples : number of samples behind it, rejected ones too
    """

    noise: float
    predicted: float
    samples: int


TOLD_METRICS: tuple[Metric[ToldNoise], ...] = (
    Metric("told_noise", SOURCE_UNIT, "√ mean R, the noise that the estimator is told", lambda one: one.noise,
           used=("apply",)),
    Metric("predicted_noise", SOURCE_UNIT, "√ mean (S − R), how unsure it is of what it predicts",
           lambda one: one.predicted),
)  # fmt: skip
"""Of the present set alone, by axis."""


def told_noises(record: ReplayedSet, intervals: Sequence[Interval]) -> dict[SourceAxis, ToldNoise]:
    """What the estimator was told of each source that it fused, by source and axis.

    Parameters
    ----------
    record : replay of the flight
    intervals : samples inside them count, µs
    """
    found = {}
    for key in record.first_fused:
        if MEASURED_SOURCES[key[0]].every_update:
            continue
        one = told_noise(record.samples[key], intervals)
        if one is not None:
            found[key] = one
    return found


def told_noise(samples: AxisSamples, intervals: Sequence[Interval]) -> ToldNoise | None:
    """What the estimator was told of one axis; None where it is not known or there are too few samples."""
    rows = inside(samples.timestamp_sample, intervals) & np.isfinite(samples.observation_variance)
    rows &= np.isfinite(samples.innovation_variance) & (samples.observation_variance > 0.0)
    if np.count_nonzero(rows) < FEWEST_SAMPLES:
        return None
    variance = samples.observation_variance[rows]
    prediction = np.maximum(samples.innovation_variance[rows] - variance, 0.0)
    return ToldNoise(
        float(np.sqrt(variance.mean())),
        float(np.sqrt(prediction.mean())),
        int(np.count_nonzero(rows)),
    )
