"""A flight in a world of the second simulator, as its log would hold it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks.thinned_logs import Thinning, thinned

from fusetune.execute.onboard_estimator import estimator_topics
from fusetune.px4.flight import Flight, ParameterHistory, ParameterValue, TopicTable, select_rows
from fusetune.px4.logger_settings import DEFAULT_SET_BIT, FROM_BOOT, PROFILE_FOR_REPLAY, WHEN_ARMED
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.px4.releases import BASELINE

from .aiding import vehicle_air_data, vehicle_gps_position, vehicle_magnetometer
from .chance import streams
from .imu import sensor_combined
from .path import fly_path
from .settings import SecondWorld
from .truth import STEP_S, true_motion
from .vehicle import armed_us, groundtruth_topics, vehicle_topics


def fly(world: SecondWorld, number: int, seed: int) -> Flight:
    """Flight `number` of a world; the same seed gives the same flight.

    Where only the default profile is logged, the vehicle's own estimator is PX4's, run on all that was measured: such
    a log is replayed from its state.
    """
    chance = streams(seed)
    path = fly_path(world.kinds[number % len(world.kinds)], world.airborne_s, STEP_S, chance["path"])
    from_deg = chance["wind"].uniform(0.0, 360.0)
    strength = world.wind_m_s * chance["wind"].uniform(0.3, 1.0)
    wind = -strength * np.array([np.cos(np.radians(from_deg)), np.sin(np.radians(from_deg)), 0.0])
    truth = true_motion(path, wind)
    sensed = {
        ("sensor_combined", 0): sensor_combined(truth, world.imu, chance),
        ("vehicle_gps_position", 0): vehicle_gps_position(truth, world.gnss, chance["gnss"]),
        ("vehicle_magnetometer", 0): vehicle_magnetometer(truth, world.magnetometer, chance["magnetometer"]),
        ("vehicle_air_data", 0): vehicle_air_data(truth, world.barometer, chance["barometer"]),
        **vehicle_topics(truth),
    }
    flight = Flight(
        name=f"{world.name}_{number:02}",
        topics=sensed | groundtruth_topics(truth),
        parameters=_parameters(world),
        info={
            "sys_name": "PX4",
            "ver_hw": "SECOND_SIMULATOR",
            "ver_sw": "0" * 40,
            "ver_sw_release": BASELINE[0] << 24 | BASELINE[1] << 16 | 255,
        },
        start_timestamp=int(sensed["sensor_combined", 0]["timestamp"][0]),
        last_timestamp=int(sensed["sensor_combined", 0]["timestamp"][-1]),
    )
    return _as_default_profile(flight, armed_us(truth), seed) if world.default_profile else flight


def _as_default_profile(flight: Flight, from_us: int, seed: int) -> Flight:
    everything = flight.with_topics(flight.topics | estimator_topics(flight))
    small = thinned(everything, Thinning(seed=seed))
    topics = {key: _from(table, from_us) for key, table in small.topics.items()}
    return replace(small, topics=topics, start_timestamp=int(topics["sensor_combined", 0]["timestamp"][0]))


def _from(table: TopicTable, first_us: int) -> TopicTable:
    """Rows from a time on, and the last one before, with which the logger begins a topic."""
    first = int(np.searchsorted(table["timestamp"], first_us))
    return select_rows(
        table, np.arange(first if len(table["timestamp"]) > first else first - 1, len(table["timestamp"]))
    )


def _parameters(world: SecondWorld) -> ParameterHistory:
    defaults = _typed({name: one.default for name, one in PARAMETERS.items()})
    logging: dict[str, ParameterValue] = (
        {"SDLOG_MODE": WHEN_ARMED, "SDLOG_PROFILE": DEFAULT_SET_BIT}
        if world.default_profile
        else {"SDLOG_MODE": FROM_BOOT, "SDLOG_PROFILE": PROFILE_FOR_REPLAY}
    )
    system: dict[str, ParameterValue] = {"MAV_TYPE": 2, "SYS_AUTOSTART": 4001, "SENS_BARO_QNH": 1013.25}
    initial = defaults | _typed(world.parameters) | system | logging
    return ParameterHistory(initial=initial, default_system=dict(defaults), default_current_setup=dict(defaults))


def _typed(values) -> dict[str, ParameterValue]:  # type: ignore[no-untyped-def]
    return {
        name: int(one) if PARAMETERS[name].type == "INT32" else float(np.float32(one)) for name, one in values.items()
    }
