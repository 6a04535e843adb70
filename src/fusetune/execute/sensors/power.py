"""What drives the vehicle (`vehicle_thrust_setpoint`, `actuator_motors`, `battery_status`): throttle and current."""

from __future__ import annotations

import numpy as np

from fusetune.execute.noise import random_stream
from fusetune.execute.vehicle import Airframe, Battery
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable

MOTORS, OUTPUTS = 4, 12
MOTOR_INTERVAL_US, BATTERY_INTERVAL_US = 20_000, 100_000
FULL_CELL_V = 4.15
CONNECTED_BY_CURRENT_SENSOR = 0


def throttle(truth: Truth, airframe: Airframe, timestamp_us: np.ndarray) -> np.ndarray:
    """Share of full throttle, (N,): thrust is made linear in it, as PX4's THR_MDL_FAC is for, so it is that of hover
    times the square of the rotor speed."""
    return np.asarray(airframe.hover_throttle * truth.at(timestamp_us, truth.rotor_speed) ** 2)


def actuator_motors(truth: Truth, airframe: Airframe) -> TopicTable:
    """Throttle of the motors, all alike, fifty times a second; outputs without a motor are NaN."""
    timestamp = _grid(truth, MOTOR_INTERVAL_US)
    control = np.clip(throttle(truth, airframe, timestamp), 0.0, 1.0).astype(np.float32)
    nothing = np.full(len(timestamp), np.nan, np.float32)
    return {
        "timestamp": timestamp,
        "timestamp_sample": timestamp.copy(),
        **{f"control[{index}]": (control if index < MOTORS else nothing).copy() for index in range(OUTPUTS)},
        "reversible_flags": np.zeros(len(timestamp), np.uint16),
    }


def vehicle_thrust_setpoint(motors: TopicTable) -> TopicTable:
    """What the motors are asked for, along the body's down axis."""
    nothing = np.zeros_like(motors["control[0]"])
    thrust = {"xyz[0]": nothing, "xyz[1]": nothing.copy(), "xyz[2]": -motors["control[0]"]}
    return {name: motors[name].copy() for name in ("timestamp", "timestamp_sample")} | thrust


def battery_status(truth: Truth, airframe: Airframe, battery: Battery, seed: int) -> TopicTable:
    """Voltage and current ten times a second: the current of a rotor grows with its thrust, the square of its speed."""
    rng = random_stream(seed, "battery")
    timestamp = _grid(truth, BATTERY_INTERVAL_US)
    thrust = throttle(truth, airframe, timestamp) / airframe.hover_throttle
    current = battery.avionics_current_a + battery.hover_current_a * thrust
    measured = (current + battery.current_noise_a * rng.standard_normal(len(timestamp))).astype(np.float32)
    voltage = (battery.cells * FULL_CELL_V - battery.resistance_ohm * current).astype(np.float32)
    samples = len(timestamp)
    return {
        "timestamp": timestamp,
        "voltage_v": voltage,
        "current_a": measured,
        "current_average_a": np.full(samples, battery.hover_current_a, np.float32),
        "discharged_mah": (np.cumsum(current) * BATTERY_INTERVAL_US * 1e-6 / 3.6).astype(np.float32),
        "cell_count": np.full(samples, battery.cells, np.uint8),
        "source": np.full(samples, CONNECTED_BY_CURRENT_SENSOR, np.uint8),
        "id": np.ones(samples, np.uint8),
        "connected": np.ones(samples, np.bool_),
    }


def _grid(truth: Truth, interval_us: int) -> np.ndarray:
    return np.arange(truth.timestamp_us[0], truth.timestamp_us[-1], interval_us, dtype=np.int64)
