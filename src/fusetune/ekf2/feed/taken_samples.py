"""The samples that the estimator takes of every aiding sensor, and the run at which each arrives.

Of every topic the newest message since the last run counts; if the estimator is not given that one, nothing arrives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fusetune.ekf2.feed import message_samples as convert
from fusetune.ekf2.feed.arrival_order import RunSchedule
from fusetune.ekf2.feed.range_selection import select_range_samples
from fusetune.ekf2.feed.sensor_samples import (
    AIRSPEED_SAMPLE,
    AUXVEL_SAMPLE,
    BARO_SAMPLE,
    EV_SAMPLE,
    FLOW_SAMPLE,
    GNSS_SAMPLE,
    MAG_SAMPLE,
)
from fusetune.px4.flight import Flight, TopicTable, row_count

AIRSPEED_VALIDATED_MAX_AGE_US = 3_000_000


@dataclass(frozen=True)
class TakenSamples:
    """Samples of one sensor.

    Attributes
    ----------
    samples : one per message, used or not
    arrival : (runs,) which of them arrives at each run, -1 for none
    beside : (samples, …) what takes effect with a sample as it arrives: air density (kg/m³) or limits of the sensor
    """

    samples: np.ndarray
    arrival: np.ndarray
    beside: np.ndarray = field(default_factory=lambda: np.zeros(0))


def only_usable(newest: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """The newest messages, -1 where the estimator is not given it."""
    if not len(usable):
        return newest
    return np.where((newest >= 0) & usable[newest], newest, -1)


def _gnss(flight: Flight, runs: RunSchedule) -> TakenSamples:
    def refusals(table: TopicTable) -> list[convert.Refusal]:
        return convert.gnss_refusals(table, flight.release)

    return _of_topic(flight, runs, "vehicle_gps_position", GNSS_SAMPLE, convert.gnss_samples, refusals)


def _mag(flight: Flight, runs: RunSchedule) -> TakenSamples:
    return _of_topic(flight, runs, "vehicle_magnetometer", MAG_SAMPLE, convert.mag_samples)


def _baro(flight: Flight, runs: RunSchedule) -> TakenSamples:
    table = flight.topic("vehicle_air_data")
    if table is None:
        return _nothing(runs, BARO_SAMPLE)
    samples, air_density = convert.baro_samples(table)
    return TakenSamples(samples, runs.newest_message("vehicle_air_data", table["timestamp"]), air_density)


def _range(flight: Flight, runs: RunSchedule) -> TakenSamples:
    ranges = select_range_samples(flight, runs)
    return TakenSamples(ranges.samples, ranges.arrival, ranges.limits)


def _flow(flight: Flight, runs: RunSchedule) -> TakenSamples:
    table = flight.topic("vehicle_optical_flow")
    if table is None:
        return _nothing(runs, FLOW_SAMPLE, np.zeros((0, 3)))
    samples, limits = convert.flow_samples(table)
    newest = runs.newest_message("vehicle_optical_flow", table["timestamp"])
    return TakenSamples(samples, only_usable(newest, convert.taken(table, convert.flow_refusals(table))), limits)


def _vision(flight: Flight, runs: RunSchedule) -> TakenSamples:
    table = flight.topic("vehicle_visual_odometry")
    if table is None:
        return _nothing(runs, EV_SAMPLE)
    samples, usable = convert.vision_samples(table, flight.release)
    newest = runs.newest_message("vehicle_visual_odometry", table["timestamp"])
    return TakenSamples(samples, only_usable(newest, usable))


def _auxvel(flight: Flight, runs: RunSchedule) -> TakenSamples:
    samples, refusals = convert.auxvel_samples, convert.auxvel_refusals
    return _of_topic(flight, runs, "landing_target_pose", AUXVEL_SAMPLE, samples, refusals)


def _airspeed(flight: Flight, runs: RunSchedule) -> TakenSamples:
    """Validated airspeed where it is published, the raw sensor after 3 s without it.

    A release that knew the raw sensor only had that where the validated airspeed came from none.
    """
    validated, raw = flight.topic("airspeed_validated"), flight.topic("airspeed")
    samples = np.zeros(0, AIRSPEED_SAMPLE)
    arrival = np.full(len(runs.timestamp), -1)
    reads_validated = flight.release is None or flight.release >= convert.USES_VALIDATED_AIRSPEED
    never = 0 if reads_validated else -AIRSPEED_VALIDATED_MAX_AGE_US
    last_validated = np.full(len(runs.timestamp), never, np.int64)
    is_validated = np.zeros(len(runs.timestamp), dtype=bool)
    if validated is not None and row_count(validated):
        samples = convert.validated_airspeed_samples(validated)
        usable = convert.taken(validated, convert.validated_airspeed_refusals(validated, flight.release))
        newest = runs.newest_message("airspeed_validated", validated["timestamp"])
        arrival = only_usable(newest, usable)
        heard = newest if reads_validated else arrival
        is_validated = heard >= 0
        seen = np.where(is_validated, validated["timestamp"].astype(np.int64)[heard], never)
        last_validated = np.concatenate([[never], np.maximum.accumulate(seen)[:-1]])
    if raw is not None:
        scale = float(flight.parameters.initial.get("ASPD_SCALE_1", 1.0))
        usable = convert.taken(raw, convert.airspeed_refusals(raw))
        newest = only_usable(runs.newest_message("airspeed", raw["timestamp"]), usable)
        stale = runs.timestamp - last_validated > AIRSPEED_VALIDATED_MAX_AGE_US
        arrival = np.where((newest >= 0) & stale & ~is_validated, newest + len(samples), arrival)
        samples = np.concatenate([samples, convert.airspeed_samples(raw, scale)])
    return TakenSamples(samples, arrival)


def _of_topic(
    flight: Flight,
    runs: RunSchedule,
    topic: str,
    dtype: np.dtype[Any],
    to_samples: Callable[[TopicTable], np.ndarray],
    refusals: Callable[[TopicTable], list[convert.Refusal]] | None = None,
) -> TakenSamples:
    table = flight.topic(topic)
    if table is None:
        return _nothing(runs, dtype)
    newest = runs.newest_message(topic, table["timestamp"])
    if refusals is not None:
        newest = only_usable(newest, convert.taken(table, refusals(table)))
    return TakenSamples(to_samples(table), newest)


def _nothing(runs: RunSchedule, dtype: np.dtype[Any], beside: np.ndarray | None = None) -> TakenSamples:
    nothing = np.full(len(runs.timestamp), -1)
    return TakenSamples(np.zeros(0, dtype), nothing, np.zeros(0) if beside is None else beside)


AIDING: Mapping[str, Callable[[Flight, RunSchedule], TakenSamples]] = {
    "gnss": _gnss,
    "mag": _mag,
    "baro": _baro,
    "range": _range,
    "flow": _flow,
    "ev": _vision,
    "airspeed": _airspeed,
    "auxvel": _auxvel,
}
"""Aiding sensors by their names in the estimator's inputs."""
