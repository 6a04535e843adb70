"""Which innovations of a replay belong to measured samples, and which to reconstructed ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fusetune.analyze.reconstruction.reconstructed_flight import BARO, MAG, ReconstructedFlight
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.px4.sample_times import measurement_time

SENSORS = {"mag": (MAG, "EKF2_MAG_DELAY"), "baro_hgt": (BARO, "EKF2_BARO_DELAY")}
"""Aid source → topic of its measurements and the parameter of their delay."""


def measured_rows(
    innovations: np.ndarray, reconstructed: ReconstructedFlight, parameters: Mapping[str, float], interval_us: float
) -> np.ndarray:
    """For each innovation row whether its measurement stands in the log.

    The estimator stamps a sample with its time less the sensor's delay and half an update interval; adding both back
    gives the sample.

    Parameters
    ----------
    innovations : rows of a `fusetune.ekf2.replay.results.ReplayResult`
    parameters : the complete set of the replay
    interval_us : update interval of the replay
    """
    measured = np.ones(len(innovations), np.bool_)
    for source, (topic, delay) in SENSORS.items():
        mask = reconstructed.measured.get(topic)
        if mask is None:
            continue
        rows = np.flatnonzero(innovations["source"] == AID_SOURCE_NAMES.index(source))
        time = measurement_time(topic, reconstructed.flight.topics[topic, 0])
        order = np.argsort(time, kind="stable")
        wanted = innovations["timestamp_sample"][rows] + parameters[delay] * 1e3 + 0.5 * interval_us
        measured[rows] = mask[order[_nearest(time[order], wanted)]]
    return measured


def _nearest(time: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    right = np.clip(np.searchsorted(time, wanted), 1, max(len(time) - 1, 1))
    right = np.minimum(right, len(time) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(np.abs(time[left] - wanted) <= np.abs(time[right] - wanted), left, right)
