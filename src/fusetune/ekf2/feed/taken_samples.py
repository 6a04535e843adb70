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
from fusetune.px4.aid_sources import SENSORS
from fusetune.px4.flight import Flight, TopicTable, row_count
from fusetune.px4.releases import VALIDATED_AIRSPEED, Release

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


_Refusals = Callable[[TopicTable, Release | None], list[convert.Refusal]]


def _in_every_release(refusals: Callable[[TopicTable], list[convert.Refusal]]) -> _Refusals:
    return lambda table, release: refusals(table)


@dataclass(frozen=True)
class OfOneTopic:
    """A sensor whose samples are the messages of instance 0 of one topic, less those that are refused.

    Attributes
    ----------
    samples : table → samples, or these and what is `beside` them
    refusals : table and release of the log → messages that the estimator is not given
    """

    sensor: str
    dtype: np.dtype[Any]
    samples: Callable[[TopicTable], np.ndarray | tuple[np.ndarray, np.ndarray]]
    refusals: _Refusals = lambda table, release: []
    beside_nothing: tuple[int, ...] = (0,)

    @property
    def topic(self) -> str:
        return SENSORS[self.sensor].topics[0].name

    def __call__(self, flight: Flight, runs: RunSchedule) -> TakenSamples:
        table, beside = flight.topic(self.topic), np.zeros(self.beside_nothing)
        if table is None:
            return TakenSamples(np.zeros(0, self.dtype), np.full(len(runs.timestamp), -1), beside)
        samples = self.samples(table)
        if isinstance(samples, tuple):
            samples, beside = samples
        newest = runs.newest_message(self.topic, table["timestamp"])
        refusals = self.refusals(table, flight.release)
        return TakenSamples(samples, only_usable(newest, convert.taken(table, refusals)), beside)


def _range(flight: Flight, runs: RunSchedule) -> TakenSamples:
    ranges = select_range_samples(flight, runs)
    return TakenSamples(ranges.samples, ranges.arrival, ranges.limits)


def _vision(flight: Flight, runs: RunSchedule) -> TakenSamples:
    table = flight.topic("vehicle_visual_odometry")
    if table is None:
        return TakenSamples(np.zeros(0, EV_SAMPLE), np.full(len(runs.timestamp), -1))
    samples, usable = convert.vision_samples(table, flight.release)
    newest = runs.newest_message("vehicle_visual_odometry", table["timestamp"])
    return TakenSamples(samples, only_usable(newest, usable))


def _airspeed(flight: Flight, runs: RunSchedule) -> TakenSamples:
    """Validated airspeed where it is published, the raw sensor after 3 s without it.

    A release that knew the raw sensor only had that where the validated airspeed came from none.
    """
    validated, raw = flight.topic("airspeed_validated"), flight.topic("airspeed")
    samples = np.zeros(0, AIRSPEED_SAMPLE)
    arrival = np.full(len(runs.timestamp), -1)
    reads_validated = flight.release is None or flight.release >= VALIDATED_AIRSPEED
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


AIDING: Mapping[str, Callable[[Flight, RunSchedule], TakenSamples]] = {
    "gnss": OfOneTopic("gnss", GNSS_SAMPLE, convert.gnss_samples, convert.gnss_refusals),
    "mag": OfOneTopic("mag", MAG_SAMPLE, convert.mag_samples),
    "baro": OfOneTopic("baro", BARO_SAMPLE, convert.baro_samples),
    "range": _range,
    "flow": OfOneTopic(
        "flow", FLOW_SAMPLE, convert.flow_samples, _in_every_release(convert.flow_refusals), beside_nothing=(0, 4)
    ),
    "ev": _vision,
    "airspeed": _airspeed,
    "auxvel": OfOneTopic("auxvel", AUXVEL_SAMPLE, convert.auxvel_samples, _in_every_release(convert.auxvel_refusals)),
}
"""Aiding sensors by their names in the estimator's inputs."""
