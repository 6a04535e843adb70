"""Which measurement a sample of a replay is of.

The estimator stamps a sample with the time of the measurement less the source's delay parameter, so a set with
another delay stamps the same measurement otherwise. Adding the delay back gives a time that names the measurement.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.px4.aid_sources import AID_SOURCES


def measurement_time(samples: AxisSamples, source: str, parameters: Mapping[str, float]) -> npt.NDArray[np.int64]:
    """Time of each measurement, µs: the estimator's sample time plus the source's delay."""
    name = AID_SOURCES[source].delay_parameter
    delay_ms = parameters.get(name, 0.0) if name is not None else 0.0
    return samples.timestamp_sample + round(delay_ms * 1e3)


def match(reference: npt.NDArray[np.int64], time: npt.NDArray[np.int64], tolerance_us: float) -> npt.NDArray[np.int64]:
    """Index into `time` of the sample nearest to each of `reference`, or −1 where none is within the tolerance.

    Both ascending; (N,) and (M,), µs.
    """
    if time.size == 0:
        return np.full(reference.shape, -1, dtype=np.int64)
    right = np.clip(np.searchsorted(time, reference), 0, time.size - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.where(np.abs(time[left] - reference) <= np.abs(time[right] - reference), left, right)
    return np.where(np.abs(time[nearest] - reference) <= tolerance_us, nearest, -1)
