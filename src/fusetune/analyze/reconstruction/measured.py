"""Which innovations of a replay belong to measured samples, and which to reconstructed ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fusetune.analyze.reconstruction.reconstructed_flight import ReconstructedFlight
from fusetune.px4.aid_sources import AID_SOURCES, RECORDED_SOURCES, SENSORS
from fusetune.px4.sample_times import measurement_time


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
    for number, source in enumerate(map(AID_SOURCES.__getitem__, RECORDED_SOURCES)):
        if not source.sensor:
            continue
        sensor = SENSORS[source.sensor]
        topic = sensor.topics[0].name
        mask = reconstructed.measured.get(topic)
        if mask is None:
            continue
        rows = np.flatnonzero(innovations["source"] == number)
        time = measurement_time(topic, reconstructed.flight.topics[topic, 0])
        order = np.argsort(time, kind="stable")
        wanted = innovations["timestamp_sample"][rows] + parameters[sensor.delay_parameter] * 1e3 + 0.5 * interval_us
        measured[rows] = mask[order[_nearest(time[order], wanted)]]
    return measured


def _nearest(time: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    right = np.clip(np.searchsorted(time, wanted), 1, max(len(time) - 1, 1))
    right = np.minimum(right, len(time) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(np.abs(time[left] - wanted) <= np.abs(time[right] - wanted), left, right)
