"""What is injected: the kinds of causes, how large they are drawn, and from where on a magnitude is visible.

A magnitude is *visible* where the fault changes something that is measured by more than a sound vehicle of the study
shows; `visible_from` says what that is. Only visible ones count in the study's shares.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusetune.execute.vehicle import Vehicle

from .missions import ALONG_THE_NOSE, FAST, MOTIONS, MOVING, RECIPES

Entry = dict[str, Any]
Drawn = tuple[list[Entry], float]
"""Entries of a faults file, and the magnitude."""
BEFORE_S, ALL_FLIGHT_S = -13.0, 300.0
"""From before the sensors settle, to after the landing."""
TAKEOFF_AFTER_S, LANDING_AFTER_S = 14.0, 75.0
"""Since boot, about."""
G_M_S2 = 9.80665
HORIZONTAL_FIELD_GAUSS = 0.21
"""Of the earth where the missions are flown."""


@dataclass(frozen=True)
class Kind:
    """A cause and how it is injected.

    Attributes
    ----------
    id : of the cause
    group : kinds of one group are not put together in a pair
    magnitude : what the magnitude is, with its unit
    visible_from : least visible magnitude
    why : what shows from there on
    draw : entries and magnitude, for a vehicle
    sensors : what the vehicle needs beside the usual sensors; None where that does not matter
    motions : missions that excite it
    recipe : what the guide wants flown for it, instead of these where it is alone
    """

    id: str
    group: str
    magnitude: str
    visible_from: float
    why: str
    draw: Callable[[np.random.Generator, Vehicle], Drawn]
    sensors: tuple[str, ...] | None = None
    motions: tuple[str, ...] = MOVING
    recipe: tuple[str, ...] = ()


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """Drawn evenly in the logarithm, so that barely visible ones are as frequent as gross ones."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _direction(rng: np.random.Generator, down: float = 1.0) -> np.ndarray:
    vector = rng.standard_normal(3) * np.array([1.0, 1.0, down])
    return np.asarray(vector / np.linalg.norm(vector))


def _floats(values: Sequence[float] | np.ndarray) -> list[float]:
    return [round(float(value), 6) for value in values]


def _while(rng: np.random.Generator, shortest_s: float, longest_s: float) -> dict[str, float]:
    """Some time in the air."""
    return {
        "start_s": round(float(rng.uniform(8.0, 18.0)), 2),
        "duration_s": round(float(rng.uniform(shortest_s, longest_s)), 2),
    }


def _all_flight() -> dict[str, float]:
    return {"start_s": BEFORE_S, "duration_s": ALL_FLIGHT_S}


def _told(parameter: str, value: float) -> Entry:
    return {"kind": "told_wrong", "parameter": parameter, "value": round(value, 6)}


def _vibration(rng: np.random.Generator, vehicle: Vehicle) -> Drawn:
    if rng.random() < 0.5:
        tone = vehicle.imu.vibration.accelerometer_tone
        amplitude = _between(rng, 2.0, 30.0)
        return [{"kind": "vibration", **_all_flight(), "factor": max(amplitude / tone, 1.01)}], amplitude / 8.0
    offset = _between(rng, 0.2, 3.0)
    along = _floats(offset * np.array([0.25, 0.15, 1.0]) * _sign(rng))
    entry = {"kind": "aliased_vibration", "offset_m_s2": along, "beat_m_s2": offset, "beat_hz": rng.uniform(0.7, 4.0)}
    return [entry], offset / 0.5


def _clipping(rng: np.random.Generator, _: Vehicle) -> Drawn:
    amplitude = _between(rng, 150.0, 330.0)
    frequency = float(rng.uniform(40.0, 75.0))
    entry = {"kind": "clipping", **_while(rng, 4.0, 20.0), "amplitude_m_s2": amplitude, "frequency_hz": frequency}
    return [entry], amplitude


def _gyro_bias(rng: np.random.Generator, _: Vehicle) -> Drawn:
    if rng.random() < 0.7:
        size, time_s = _between(rng, 0.05, 0.45), float(rng.uniform(25.0, 60.0))
        in_flight = size * (math.exp(-TAKEOFF_AFTER_S / time_s) - math.exp(-LANDING_AFTER_S / time_s))
        entry = {"kind": "gyro_bias", "warming_rad_s": _floats(size * _direction(rng)), "warming_time_s": time_s}
        return [entry], in_flight / math.radians(3.0)
    size = _between(rng, 0.05, 0.16)
    return [{"kind": "gyro_bias", "turn_on_rad_s": _floats(size * _direction(rng))}], size / math.radians(5.0)


def _yaw_alignment(rng: np.random.Generator, _: Vehicle) -> Drawn:
    wrong_deg = _between(rng, 8.0, 70.0)
    # Across the field that it sees when it stands with its nose north, whichever way it does stand.
    size, angle = HORIZONTAL_FIELD_GAUSS * math.tan(math.radians(wrong_deg)), rng.uniform(0.0, 2.0 * math.pi)
    field = _floats([size * math.cos(angle), size * math.sin(angle), 0.0])
    return [{"kind": "body_field", "field_gauss": field}], wrong_deg


def _magnetic_disturbance(rng: np.random.Generator, _: Vehicle) -> Drawn:
    size = _between(rng, 0.03, 0.5)
    if rng.random() < 0.75:
        field = _floats(size * _direction(rng))
        return [{"kind": "magnetic_disturbance", **_while(rng, 6.0, 20.0), "field_gauss": field}], size
    field = _floats([0.1 * size, 0.1 * size, size * _sign(rng)])
    return [{"kind": "body_field", "field_gauss": field}], size


def _motor_field(rng: np.random.Generator, _: Vehicle) -> Drawn:
    size = _between(rng, 0.015, 0.3)
    return [{"kind": "motor_field", "field_gauss": _floats(size * _direction(rng))}], size


def _rotated(rng: np.random.Generator, _: Vehicle) -> Drawn:
    turns = ({"yaw_deg": 90}, {"yaw_deg": -90}, {"yaw_deg": 180}, {"yaw_deg": 45}, {"yaw_deg": -45}, {"roll_deg": 180})
    turn = turns[int(rng.integers(len(turns)))]
    return [{"kind": "magnetometer_rotation", **turn}], float(max(abs(value) for value in turn.values()))


def _magnetometer_scale(rng: np.random.Generator, _: Vehicle) -> Drawn:
    largest = _between(rng, 0.06, 0.4)
    off = np.clip(largest * rng.uniform(-1.0, 1.0, 3), -0.3, 0.4)
    worst = int(rng.integers(3))
    off[worst] = -min(largest, 0.3) if rng.random() < 0.5 else largest
    return [{"kind": "magnetometer_scale", "scale": _floats(1.0 + off)}], float(np.abs(off).max())


def _gnss_accuracy(rng: np.random.Generator, _: Vehicle) -> Drawn:
    factor = _between(rng, 1.8, 15.0)
    when = _all_flight() if rng.random() < 0.3 else _while(rng, 15.0, 30.0)
    return [{"kind": "gnss_accuracy", **when, "factor": factor}], factor


def _gnss_glitch(rng: np.random.Generator, _: Vehicle) -> Drawn:
    size = _between(rng, 2.0, 30.0)
    along = _direction(rng, down=0.4)
    moves = rng.random() < 0.4
    entry = {"kind": "gnss_glitch", **_while(rng, 2.0, 12.0), "offset_m": _floats(size * along)}
    if moves:
        entry["velocity_offset_m_s"] = _floats(_between(rng, 0.8, 4.0) * along)
    return [entry], size


def _gnss_loss(rng: np.random.Generator, _: Vehicle) -> Drawn:
    duration = _between(rng, 1.2, 25.0)
    when = {"start_s": float(rng.uniform(10.0, 18.0)), "duration_s": duration}
    return [{"kind": "gnss_outage", **when, "silent": bool(rng.random() < 0.4)}], duration


def _interference(rng: np.random.Generator, _: Vehicle) -> Drawn:
    strength = _between(rng, 0.1, 1.0)
    return [{"kind": "gnss_interference", **_while(rng, 10.0, 30.0), "strength": strength}], strength


def _wrong_delay(parameter: str, low: float, high: float) -> Callable[[np.random.Generator, Vehicle], Drawn]:
    def draw(rng: np.random.Generator, vehicle: Vehicle) -> Drawn:
        right = vehicle.parameters[parameter]
        wrong = _between(rng, low, high)
        sign = _sign(rng)
        told = right + wrong * sign if 0.0 <= right + wrong * sign <= 300.0 else right + wrong
        return [_told(parameter, round(told))], wrong

    return draw


def _lever_arm(rng: np.random.Generator, vehicle: Vehicle) -> Drawn:
    size = _between(rng, 0.07, 0.65)
    told = np.array(vehicle.gnss.antenna_position_m) + size * _direction(rng, down=0.5)
    return [_told(f"EKF2_GPS_POS_{axis}", value) for axis, value in zip("XYZ", told, strict=True)], size


def _ground_effect(rng: np.random.Generator, vehicle: Vehicle) -> Drawn:
    depth = _between(rng, 0.5, 5.0)
    return [{"kind": "ground_effect", "depth_m": depth}], depth + vehicle.barometer.ground_effect_m


def _static_pressure(rng: np.random.Generator, _: Vehicle) -> Drawn:
    largest = _between(rng, 0.12, 0.5)
    names = ("forward", "backward", "right", "left")
    shares = dict(zip(names, largest * rng.uniform(-0.4, 1.0, 4), strict=True))
    shares[str(rng.choice(names[:2]))] = largest
    sign = _sign(rng)
    entry = {"kind": "static_pressure"} | {name: round(sign * share, 4) for name, share in shares.items()}
    return [entry], largest * 8.0**2 / (2.0 * G_M_S2)


def _propeller_wash(rng: np.random.Generator, _: Vehicle) -> Drawn:
    height = _between(rng, 0.5, 8.0)
    return [{"kind": "propeller_wash", "height_m": height * _sign(rng)}], height


def _baro_drift(rng: np.random.Generator, _: Vehicle) -> Drawn:
    height = _between(rng, 0.8, 12.0)
    return [{"kind": "baro_drift", **_while(rng, 12.0, 35.0), "height_m": height * _sign(rng)}], height


def _obstruction(rng: np.random.Generator, _: Vehicle) -> Drawn:
    when = _while(rng, 1.0, 40.0) if rng.random() < 0.7 else _all_flight()
    share = 1.0 if rng.random() < 0.6 else float(rng.uniform(0.15, 0.7))
    entry = {"kind": "range_obstruction", **when, "distance_m": float(rng.uniform(0.12, 0.6)), "share": share}
    return [entry], share * min(when["duration_s"], 50.0)


def _range_steps(rng: np.random.Generator, _: Vehicle) -> Drawn:
    height = _between(rng, 0.08, 2.5)
    starts = np.sort(rng.uniform(8.0, 42.0, int(rng.integers(2, 6))))
    return [
        {"kind": "range_step", "start_s": float(start), "duration_s": float(rng.uniform(1.5, 6.0)), "height_m": height}
        for start in starts
    ], height


def _flow_scale(rng: np.random.Generator, _: Vehicle) -> Drawn:
    off = _between(rng, 0.06, 0.7)
    return [{"kind": "flow_scale", "factor": math.exp(off * _sign(rng))}], off


def _flow_rotation(rng: np.random.Generator, _: Vehicle) -> Drawn:
    if rng.random() < 0.6:
        turned = (
            float(rng.choice([90.0, 180.0, -90.0])) if rng.random() < 0.5 else _between(rng, 5.0, 60.0) * _sign(rng)
        )
        return [{"kind": "flow_rotation", "turned_deg": turned}], abs(turned)
    return [{"kind": "flow_rotation", "gyro_share": float(rng.choice([0.0, -1.0]))}], 180.0


def _vision_yaw(rng: np.random.Generator, _: Vehicle) -> Drawn:
    turned = _between(rng, 3.0, 60.0)
    return [{"kind": "vision_yaw", "turned_deg": turned * _sign(rng)}], turned


def _vision_scale(rng: np.random.Generator, _: Vehicle) -> Drawn:
    off = _between(rng, 0.03, 0.4)
    return [{"kind": "vision_scale", "factor": math.exp(off * _sign(rng))}], off


def _vision_covariance(rng: np.random.Generator, _: Vehicle) -> Drawn:
    factor = _between(rng, 2.0, 25.0)
    return [{"kind": "vision_covariance", "error_factor": factor}], factor


def _airspeed_scale(rng: np.random.Generator, _: Vehicle) -> Drawn:
    off = _between(rng, 0.08, 0.4)
    return [{"kind": "airspeed_scale", "factor": math.exp(off * _sign(rng))}], off


def _noise_claim(rng: np.random.Generator, vehicle: Vehicle) -> Drawn:
    """Told far less than what the sensor does, or far more than that and than PX4's default."""
    factor = _between(rng, 2.0, 12.0)
    usual = (("EKF2_GPS_V_NOISE", 0.3, 5.0), ("EKF2_GPS_P_NOISE", 0.7, 10.0), ("EKF2_MAG_NOISE", 0.05, 1.0))
    if rng.random() < 0.5:
        parameter, default, largest = usual[int(rng.integers(len(usual)))]
        told = min(default * factor, 0.95 * largest)
        return [_told(parameter, told)], told / default
    if rng.random() < 0.5:
        return [_told("EKF2_BARO_NOISE", max(vehicle.barometer.noise_m / factor, 0.011))], factor
    return [_told("EKF2_MAG_NOISE", max(vehicle.magnetometer.noise_gauss / min(factor, 5.5), 0.00105))], min(
        factor, 5.5
    )


LARGEST = {
    "EKF2_ACC_NOISE": 1.0, "EKF2_GYR_NOISE": 0.1, "EKF2_ACC_B_NOISE": 0.01, "EKF2_GYR_B_NOISE": 0.01,
    "EKF2_MAG_E_NOISE": 0.1, "EKF2_MAG_B_NOISE": 0.1,
}  # fmt: skip


def _at_limit(rng: np.random.Generator, _: Vehicle) -> Drawn:
    if rng.random() < 0.6:
        size = _between(rng, 0.25, 1.2)
        bias = _floats([0.1 * size, -0.1 * size, size * _sign(rng)])
        return [{"kind": "accelerometer_bias", "bias_m_s2": bias}], size / 0.4
    parameter = str(rng.choice(list(LARGEST)))
    return [_told(parameter, LARGEST[parameter])], 1.2


def _imu_gaps(rng: np.random.Generator, _: Vehicle) -> Drawn:
    share, longest = _between(rng, 0.002, 0.12), int(rng.choice([4, 10, 25, 60]))
    return [{"kind": "imu_gaps", **_while(rng, 25.0, 40.0), "share": share, "longest": longest}], share


def _stuck(rng: np.random.Generator, _: Vehicle) -> Drawn:
    duration = _between(rng, 1.0, 35.0)
    sensor = str(rng.choice(["magnetometer", "barometer", "gnss"]))
    when = {"start_s": float(rng.uniform(8.0, 14.0)), "duration_s": duration}
    return [{"kind": "sensor_stuck", **when, "sensor": sensor}], duration


def _whipsaw(rng: np.random.Generator, _: Vehicle) -> Drawn:
    interval, duration = _between(rng, 0.6, 12.0), float(rng.uniform(12.0, 35.0))
    when = {"start_s": float(rng.uniform(6.0, 14.0)), "duration_s": duration}
    return [_told("EKF2_MULTI_IMU", 2), {"kind": "instance_whipsaw", **when, "interval_s": interval}], math.ceil(
        duration / interval
    )


RANGE, FLOW = ("range_finder",), ("range_finder", "optical_flow")
VISION, AIRSPEED = ("vision",), ("airspeed",)
ANY = tuple(MOTIONS)
TURNING = ("survey", "aggressive", "climbs", "stop_and_go")

# fmt: off
_KINDS = (
    Kind("vibration", "imu", "amplitude over 8 m/s², or offset over 0.5 m/s² where aliased", 1.0,
         "vibration metric several times that of a sound frame; offset beyond what EKF2 tolerates as bias",
         _vibration, motions=ANY),
    Kind("accelerometer_clipping", "imu", "amplitude, m/s²", 175.0, "raw samples reach the range", _clipping,
         motions=ANY),
    Kind("gyro_bias", "imu", "change in flight over 3 °/s, or turn-on bias over 5 °/s", 1.0,
         "beyond what the guide tolerates", _gyro_bias),
    Kind("yaw_alignment", "mag", "largest heading error, degrees", 15.0, "the guide's 15°", _yaw_alignment,
         sensors=()),
    Kind("magnetic_disturbance", "mag", "additional field, Gauss", 0.08, "a sixth of the earth's field",
         _magnetic_disturbance),
    Kind("motor_magnetic_field", "mag", "field at hover, Gauss", 0.035, "several times noise and calibration error",
         _motor_field),
    Kind("magnetometer_rotated", "mag", "turn, degrees", 45.0, "all", _rotated),
    Kind("magnetometer_scale", "mag", "largest error of a scale", 0.12, "strength off by a tenth", _magnetometer_scale),
    Kind("gnss_accuracy", "gnss", "factor", 3.5, "reported speed accuracy beyond 0.5 m/s", _gnss_accuracy),
    Kind("gnss_glitch", "gnss", "jump, m", 4.0, "beyond the gate of GNSS position", _gnss_glitch),
    Kind("gnss_loss", "gnss", "duration, s", 3.0, "aiding has stopped", _gnss_loss),
    Kind("gnss_interference", "gnss", "strength", 0.25, "the receiver itself warns", _interference),
    Kind("gnss_delay", "gnss", "error, ms", 45.0, "0.2 m/s at 4 m/s²", _wrong_delay("EKF2_GPS_DELAY", 20.0, 160.0),
         motions=FAST),
    Kind("gnss_lever_arm", "gnss", "error, m", 0.2, "0.2 m/s at 1 rad/s", _lever_arm, motions=TURNING),
    Kind("baro_ground_effect", "baro", "dip at the ground, m", 1.5, "beyond drift and noise", _ground_effect),
    Kind("static_pressure", "baro", "height error at 8 m/s, m", 0.8, "beyond drift and noise", _static_pressure,
         motions=FAST, recipe=tuple(RECIPES)),
    Kind("propeller_wash", "baro", "height error at hover, m", 1.5, "beyond drift and noise", _propeller_wash),
    Kind("baro_drift", "baro", "drift, m", 2.5, "four times the usual wander", _baro_drift),
    Kind("range_obstruction", "range", "seconds of it", 4.0, "longer than a flicker", _obstruction, RANGE),
    Kind("range_step", "range", "height, m", 0.3, "above noise and gate", _range_steps, RANGE),
    Kind("flow_scale", "flow", "error of the scale, natural logarithm", 0.15, "0.15 of the speed over ground",
         _flow_scale, FLOW),
    Kind("flow_delay", "flow", "error, ms", 50.0, "0.2 m/s at 4 m/s²", _wrong_delay("EKF2_OF_DELAY", 20.0, 160.0),
         FLOW, FAST),
    Kind("flow_rotation", "flow", "turn, degrees; 180 where its gyro is wrong", 12.0, "a fifth of the speed across it",
         _flow_rotation, FLOW, TURNING),
    Kind("vision_yaw", "vision", "turn, degrees", 8.0, "beyond the error of a compass", _vision_yaw, VISION),
    Kind("vision_scale", "vision", "error of the scale, natural logarithm", 0.08, "metres over a flight", _vision_scale,
         VISION),
    Kind("vision_delay", "vision", "error, ms", 50.0, "0.2 m/s at 4 m/s²", _wrong_delay("EKF2_EV_DELAY", 20.0, 200.0),
         VISION, FAST),
    Kind("vision_covariance", "vision", "errors over claimed", 4.0, "four times what is claimed", _vision_covariance,
         VISION),
    Kind("airspeed_scale", "airspeed", "error of the scale, natural logarithm", 0.15, "1 m/s at 7 m/s", _airspeed_scale,
         AIRSPEED, ALONG_THE_NOSE[1:]),
    Kind("noise_claim", "parameter", "told over true or usual, or the other way round", 4.0, "a factor of four",
         _noise_claim),
    Kind("parameter_at_limit", "parameter", "bias over EKF2_ABL_LIM; 1.2 where a parameter is at a bound", 1.1,
         "the state is at its limit", _at_limit),
    Kind("imu_gaps", "imu", "share lost", 0.01, "more than a busy bus loses", _imu_gaps),
    Kind("instance_whipsaw", "selector", "switches", 5.0, "more than a failure explains", _whipsaw),
    Kind("sensor_stuck", "stuck", "duration, s", 4.0, "dozens of equal samples", _stuck),
)
# fmt: on
KINDS: dict[str, Kind] = {kind.id: kind for kind in _KINDS}
