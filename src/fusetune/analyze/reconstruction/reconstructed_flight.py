"""The sensor stream of a thinned log, as near to what the vehicle's estimator saw as the log allows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from fusetune.analyze.reconstruction.attitude import steady_history
from fusetune.analyze.reconstruction.barometer import interpolate_barometer
from fusetune.analyze.reconstruction.between_samples import logged_rate_hz, sensor_rate_hz
from fusetune.analyze.reconstruction.force_by_velocity import correct_force
from fusetune.analyze.reconstruction.gyro_by_attitude import correct_gyro
from fusetune.analyze.reconstruction.imu_gaps import fill_imu_gaps, find_imu_gaps
from fusetune.analyze.reconstruction.magnetometer import interpolate_magnetometer
from fusetune.analyze.reconstruction.magnetometer_by_state import add_noise_by_state
from fusetune.analyze.reconstruction.settings import ReconstructionSettings
from fusetune.px4.flight import Flight, TopicKey, TopicTable, row_count
from fusetune.px4.flown_parameters import flown_parameters
from fusetune.px4.layouts.logged_state import LOGGED_STATE_TOPICS, LoggedState, logged_states, why_no_state
from fusetune.px4.layouts.release_layouts import ESTIMATOR_TOPICS

RECONSTRUCTION_TOPICS = (*ESTIMATOR_TOPICS, "vehicle_attitude", "vehicle_imu", *LOGGED_STATE_TOPICS)
"""What a reconstruction reads of a flight."""

FULL_MAG_RATE_HZ, FULL_BARO_RATE_HZ = 50.0, 20.0
"""Rates at which the vehicle's estimator saw the sensors before v1.12; later releases have parameters for them."""

IMU, MAG, BARO = "sensor_combined", "vehicle_magnetometer", "vehicle_air_data"


@dataclass(frozen=True)
class Step:
    """What one step of a reconstruction did."""

    sensor: str
    done: bool
    measured: int
    """Samples that the log holds."""
    added: int
    what: str


@dataclass(frozen=True)
class ReconstructedFlight:
    """A flight with reconstructed topics.

    Attributes
    ----------
    measured : topic → for each row whether the log holds it; topics that are as logged are not listed
    steps : what was done, in order
    """

    flight: Flight
    measured: dict[str, np.ndarray] = field(default_factory=dict)
    steps: tuple[Step, ...] = ()

    @property
    def changed(self) -> bool:
        return bool(self.measured)


def as_logged(flight: Flight) -> ReconstructedFlight:
    """The flight without any reconstruction."""
    return ReconstructedFlight(flight)


def reconstruct(
    flight: Flight, settings: ReconstructionSettings | None = None, start: LoggedState | None = None
) -> ReconstructedFlight:
    """Reconstruct the sensor topics of a canonical flight, for replays that start from `start` (None: cold).

    The flight given is not changed. Where nothing is missing its topics are handed on as they are. A log with
    `ekf2_timestamps` holds every magnetometer and barometer sample; if IMU rows are filled in such a log, that topic
    is left out, for it does not know the filled rows.
    """
    settings = settings or ReconstructionSettings()
    topics = dict(flight.topics)
    measured: dict[str, np.ndarray] = {}
    steps = [_fill_imu(flight, settings, topics, measured)]
    every_sample_logged = flight.topic("ekf2_timestamps") is not None
    if IMU in measured:
        topics.pop(("ekf2_timestamps", 0), None)

    def magnetometer(table: TopicTable, rate_hz: float) -> tuple[TopicTable, np.ndarray]:
        attitude = steady_history(topics.get(("vehicle_attitude", 0)), topics[IMU, 0])
        return interpolate_magnetometer(table, attitude, rate_hz, settings.max_bridge_s)

    def barometer(table: TopicTable, rate_hz: float) -> tuple[TopicTable, np.ndarray]:
        return interpolate_barometer(table, rate_hz, settings.max_bridge_s)

    mag_rate = settings.magnetometer_rate_hz or _own_rate(flight, MAG, "SENS_MAG_RATE", FULL_MAG_RATE_HZ)
    baro_rate = settings.barometer_rate_hz or _own_rate(flight, BARO, "SENS_BARO_RATE", FULL_BARO_RATE_HZ)
    for topic, wanted, below_hz, rate_hz, function in (
        (MAG, settings.magnetometer, settings.magnetometer_below_hz, mag_rate, magnetometer),
        (BARO, settings.barometer, settings.barometer_below_hz, baro_rate, barometer),
    ):
        if every_sample_logged:
            steps.append(_unchanged(topic, topics, "the log holds every sample"))
        else:
            steps.append(_interpolate(topic, wanted, below_hz, rate_hz, function, topics, measured))
    if MAG in measured and settings.magnetometer_by_state:
        repaired = flight.with_topics(dict(topics))
        steps = [
            _with_noise(step, repaired, measured[MAG], start, topics) if step.sensor == MAG else step for step in steps
        ]
    return ReconstructedFlight(flight.with_topics(topics), measured, tuple(steps))


def _with_noise(
    step: Step, flight: Flight, measured: np.ndarray, start: LoggedState | None, topics: dict[TopicKey, TopicTable]
) -> Step:
    parameters = flown_parameters(flight)
    states = tuple(logged_states(flight))
    if not states and flight.has("estimator_states"):
        return replace(step, what=f"{step.what}; without its noise, since {why_no_state(flight)}")
    noise = add_noise_by_state(flight, measured, parameters, states, start)
    if not noise.intervals:
        return step
    where = "intervals between logged states"
    if not noise.used:
        few = f"only {noise.explained} of the first {noise.intervals} {where}"
        return replace(step, what=f"{step.what}; its noise explains {few} and is left out")
    topics[MAG, 0] = noise.table
    explained = f"{noise.explained} of {noise.intervals} {where}"
    return replace(step, what=f"{step.what}, with the noise that explains {explained}")


def _own_rate(flight: Flight, topic: str, parameter: str, default_hz: float) -> float:
    """Rate at which the vehicle sampled a sensor."""
    nominal = float(flight.parameters.initial.get(parameter, 0.0))
    nominal = nominal if nominal > 0.0 else default_hz
    table = flight.topic(topic)
    return nominal if table is None else sensor_rate_hz(table, nominal)


def _unchanged(topic: str, topics: dict[TopicKey, TopicTable], why: str) -> Step:
    table = topics.get((topic, 0))
    return Step(topic, False, 0 if table is None else row_count(table), 0, why)


def _fill_imu(
    flight: Flight,
    settings: ReconstructionSettings,
    topics: dict[TopicKey, TopicTable],
    measured: dict[str, np.ndarray],
) -> Step:
    table = flight.topic(IMU)
    if table is None or not settings.imu:
        return _unchanged(IMU, topics, "switched off" if table is not None else "the log has none")
    gaps = find_imu_gaps(table)
    too_long = int((gaps.length_us > settings.imu_max_gap_s * 1e6).sum())
    left = f"; {too_long} gaps longer than {settings.imu_max_gap_s:g} s left open" if too_long else ""
    missing = int(gaps.missing.sum())
    share = missing / max(missing + row_count(table), 1)
    if share > settings.imu_max_missing:
        return _unchanged(IMU, topics, f"{share:.0%} of the rows are missing, too many to be filled")
    filled, mask = fill_imu_gaps(table, settings.imu_max_gap_s)
    if mask.all():
        return _unchanged(IMU, topics, "no row is missing" + left)
    if settings.imu_by_attitude:
        filled = correct_gyro(filled, mask, flight.topic("vehicle_attitude"))
    if settings.imu_by_velocity:
        velocity = flight.topic("vehicle_local_position")
        filled = correct_force(filled, mask, flight.topic("vehicle_attitude"), velocity)
    topics[IMU, 0], measured[IMU] = filled, mask
    added = int((~mask).sum())
    share = added / len(mask)
    return Step(IMU, True, len(mask) - added, added, f"{share:.1%} of the rows were missing and are filled{left}")


def _interpolate(
    topic: str,
    wanted: bool,
    below_hz: float,
    rate_hz: float,
    function: Callable[[TopicTable, float], tuple[TopicTable, np.ndarray]],
    topics: dict[TopicKey, TopicTable],
    measured: dict[str, np.ndarray],
) -> Step:
    table = topics.get((topic, 0))
    rate = logged_rate_hz(table)
    if table is None or rate is None:
        return _unchanged(topic, topics, "the log has none")
    if not wanted:
        return _unchanged(topic, topics, "switched off")
    if rate >= below_hz:
        return _unchanged(topic, topics, f"logged at {rate:.1f} Hz, which is not thinned")
    filled, mask = function(table, rate_hz)
    if mask.all():
        return _unchanged(topic, topics, f"logged at {rate:.1f} Hz; nothing could be interpolated")
    topics[topic, 0], measured[topic] = filled, mask
    added = int((~mask).sum())
    return Step(topic, True, len(mask) - added, added, f"interpolated from {rate:.1f} Hz to {rate_hz:.1f} Hz")
