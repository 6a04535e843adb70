"""The fit of what a magnetometer measures: earth, body, motors, and the attitude that is wrong.

    m = (1 + S) R(t)ᵀ E + h + c u(t) + noise

E is the earth's field, whose strength and dip the World Magnetic Model tells within some milligauss, R the attitude
that the gyros alone turn (`gyro_attitude`) and whose error is a constant rate, a share of the way turned, and a walk; u
is the power of the motors (`motor_power`). From before arming to the air u jumps while E does not: that is what tells c
from h.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.effects.gyro_attitude import GyroAttitude, gyro_attitude
from fusetune.analyze.effects.motor_power import MotorPower, motor_power
from fusetune.analyze.effects.told import NO_MOTION, stands_still
from fusetune.analyze.effects.walking_regression import WalkingFit, WalkingRows, fit_walking
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.feed.message_samples import gnss_samples, mag_samples
from fusetune.ekf2.numerics.world_magnetic_model import field_at

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

LARGEST_NOISE_GAUSS = 0.05
"""Residual above which the model does not hold; noisy magnetometers have a tenth of it."""
LARGEST_WALK_DEG_SQRT_S = 0.6
"""Of heading and tilt by the gyros against the field; those of autopilots have a tenth of it."""
MODEL_ERROR_GAUSS = 0.005
"""Standard deviation of the field at a place from the model of the world's."""
EXPECTED = np.array([
    MODEL_ERROR_GAUSS, MODEL_ERROR_GAUSS, *[0.3] * 3, *[10.0] * 3, *[0.05] * 3, 0.002, 0.003, *[0.02] * 6, 0.01,
])  # fmt: skip
"""Standard deviations beforehand: horizontal and vertical field, hard iron, motors, scale, drift rad/s, gyro scale,
what one axis shows of another, delay s."""
STARTS = np.array([np.inf, 0.01, 0.01])
"""The same, of heading and tilt at the beginning, rad."""
FIELD_H, FIELD_V = 0, 1
HARD, MOTOR, SCALE = slice(2, 5), slice(5, 8), slice(8, 11)
DRIFT, GYRO_SCALE = 11, 12
CROSSED = slice(13, 19)
DELAY = 19
_OTHERS = ((1, 2), (0, 2), (0, 1))
FASTEST_HZ = 12.5
_ROUNDS = 3
_FEWEST = 100
_KNOTS_S = 2.0


@dataclass(frozen=True)
class MagneticFit:
    """What was found.

    Attributes
    ----------
    fit : constants in the order of `EXPECTED`
    power : of the motors at the samples, where `has_power`
    declination_deg, level_gauss : of the world's field, and its horizontal strength
    turned : from the leftmost to the rightmost heading, rad
    heading, heading_error : the attitude, and by how much its heading is off at `time`, (N,) rad
    """

    fit: WalkingFit
    power: MotorPower
    has_power: bool
    declination_deg: float
    level_gauss: float
    turned: float
    heading: GyroAttitude
    time: Times
    heading_error: Array


def fit_magnetic(observed: ObservedFlight) -> MagneticFit | str:
    """Fit all of it; a refusal in words where the log does not hold what it takes."""
    table = observed.flight.topic("vehicle_magnetometer")
    if table is None or table["timestamp"].size < 100:
        return "the log has too few messages of the magnetometer (`vehicle_magnetometer`)"
    if observed.replayed.steps is None:
        return NO_MOTION
    world = _world_field(observed)
    if world is None:
        return "the log has no position from which the earth's field would follow"
    steps = observed.replayed.steps()
    samples = mag_samples(table)
    delay_us = round(1e3 * observed.parameters.get("EKF2_MAG_DELAY", 0.0))
    time, field = samples["time_us"] - delay_us, np.asarray(samples["mag"], np.float64)
    inside = (time > max(int(steps.time[0]), _aligned_from(observed))) & (time < steps.time[-1])
    inside &= np.isfinite(field).all(axis=1) & (np.diff(time, prepend=time[0] - 1) > 0)
    if stands_still(field[inside]):
        return "the magnetometer repeats one value"
    attitude = gyro_attitude(steps, observed.airborne)
    time, field, rotation = _thinned(time[inside], field[inside], attitude)
    if time.size < _FEWEST:
        return "magnetometer and attitude hardly overlap"
    power = motor_power(observed, time)
    known = np.isfinite(power.power)
    has_power = bool(np.count_nonzero(known) > 50 and np.ptp(power.power[known]) > 0.0)
    if has_power:
        time, field, rotation = time[known], field[known], rotation[known]
        power = MotorPower(power.kind, power.unit, power.power[known])
    drawn = power.power if has_power else np.zeros(time.size)
    time_s = np.asarray(time * 1e-6, np.float64)
    fitted = _gauss_newton(_Samples(time_s, field, rotation, attitude.turned_at(time), drawn), world)
    if fitted is None:
        return "too short a log for the magnetic field"
    if fitted[0].noise > LARGEST_NOISE_GAUSS:
        why = f"the magnetometer is {fitted[0].noise:.2f} G off the earth's field as the vehicle turns"
        return f"{why}: see first whether it is mounted as PX4 is told, or disturbed from outside"
    if math.degrees(fitted[0].walk) > LARGEST_WALK_DEG_SQRT_S:
        why = "the headings by gyros and by magnetometer part"
        return f"{why}: it is disturbed from outside, or mounted otherwise than PX4 is told"
    return MagneticFit(
        fitted[0],
        power,
        has_power,
        math.degrees(math.atan2(world[1], world[0])),
        math.hypot(*world[:2]),
        float(np.ptp(attitude.turned_at(time))),
        attitude,
        time,
        fitted[1],
    )


def _world_field(observed: ObservedFlight) -> Array | None:
    table = observed.flight.topic("vehicle_gps_position")
    if table is None:
        return None
    samples = gnss_samples(table)
    good = (samples["fix_type"] >= 3) & np.isfinite(samples["lat_deg"]) & np.isfinite(samples["lon_deg"])
    if not good.any():
        return None
    place = int(np.argmax(good))
    declination, inclination, strength = field_at(float(samples["lat_deg"][place]), float(samples["lon_deg"][place]))
    level = strength * math.cos(inclination)
    return np.array([level * math.cos(declination), level * math.sin(declination), strength * math.sin(inclination)])


def _aligned_from(observed: ObservedFlight) -> int:
    """When the replay's tilt was known, µs."""
    flags = observed.replayed.flags
    if "cs_tilt_align" not in flags or not np.any(flags["cs_tilt_align"]):
        return 0
    return int(flags["timestamp"][int(np.argmax(np.asarray(flags["cs_tilt_align"], bool)))])


def _thinned(time: Times, field: Array, attitude: GyroAttitude) -> tuple[Times, Array, Array]:
    """Means of so many neighbours that no more than `FASTEST_HZ` are left: times, fields and rotations."""
    step_s = float(np.median(np.diff(time))) * 1e-6 if time.size > 1 else 1.0
    every = max(1, round(1.0 / (FASTEST_HZ * max(step_s, 1e-3))))
    rows = time.size // every * every
    rotation = attitude.rotation_at(time[:rows]) if rows else np.zeros((0, 3, 3))
    means = (field[:rows].reshape(-1, every, 3).mean(axis=1), rotation.reshape(-1, every, 3, 3).mean(axis=1))
    return np.rint(time[:rows].reshape(-1, every).mean(axis=1)).astype(np.int64), *means


@dataclass(frozen=True)
class _Samples:
    """Fields (N, 3) at times (N,), s; attitude (N, 3, 3), how far it turned (N,), rad, and the motors' power (N,)."""

    time_s: Array
    field: Array
    rotation: Array
    turned: Array
    power: Array

    @property
    def since_s(self) -> Array:
        return np.asarray(self.time_s - self.time_s[0])


def _gauss_newton(samples: _Samples, world: Array) -> tuple[WalkingFit, Array] | None:
    """The fit and the heading's error at the samples."""
    level, scale, earth = math.hypot(world[0], world[1]), np.zeros(3), world.copy()
    error = np.full(samples.time_s.size, _first_error(samples.rotation, samples.field, world))
    fit: WalkingFit | None = None
    for number in range(_ROUNDS):
        target, design, walking = _linearised(samples, earth, scale, error)
        # fields are told as changes of the world's, scales as they are
        target = target + design[:, :2] @ earth_change(earth, world) + design[:, SCALE] @ scale
        stacked = np.tile(samples.time_s, 3)
        fit = fit_walking(
            WalkingRows(stacked, target, design, walking, EXPECTED, _KNOTS_S, starts=STARTS), fit, refined=number == 1
        )
        if fit is None:
            return None
        scale = fit.constants[SCALE].copy()
        factor = (level + fit.constants[FIELD_H]) / level
        earth = np.array([world[0] * factor, world[1] * factor, world[2] + fit.constants[FIELD_V]])
        error = np.interp(samples.time_s, fit.knot_s, fit.course[:, 0])
        error = error + fit.constants[DRIFT] * samples.since_s + fit.constants[GYRO_SCALE] * samples.turned
    assert fit is not None
    return fit, error


def _linearised(samples: _Samples, earth: Array, scale: Array, error: Array) -> tuple[Array, Array, Array]:
    """What is left of the fields (3 N,), and how it changes with the constants (3 N, P) and with the wander (3 N, 3).

    Parameters
    ----------
    earth, scale : (3,) field, and error of the scale, around which the model is taken as linear
    error : (N,) of the heading, rad
    """
    rotation, cosine, sine = samples.rotation, np.cos(error), np.sin(error)
    # the earth's field as the attitude with the wrong heading sees it, and its change with that heading
    seen = np.column_stack([cosine * earth[0] + sine * earth[1], cosine * earth[1] - sine * earth[0]])
    unit = seen / max(float(np.hypot(earth[0], earth[1])), 1e-6)
    down = rotation[:, 2]
    body = rotation[:, 0] * seen[:, :1] + rotation[:, 1] * seen[:, 1:] + down * earth[2]
    across = rotation[:, 0] * seen[:, 1:] - rotation[:, 1] * seen[:, :1]
    strong = rotation[:, 0] * unit[:, :1] + rotation[:, 1] * unit[:, 1:]
    left, designs, wanders = [], [], []
    for axis in range(3):
        gain = 1.0 + scale[axis]
        turns = gain * across[:, axis]
        design = np.zeros((samples.time_s.size, EXPECTED.size))
        design[:, FIELD_H], design[:, FIELD_V] = gain * strong[:, axis], gain * down[:, axis]
        design[:, HARD.start + axis], design[:, MOTOR.start + axis] = 1.0, samples.power
        design[:, SCALE.start + axis] = body[:, axis]
        design[:, CROSSED.start + 2 * axis : CROSSED.start + 2 * axis + 2] = body[:, _OTHERS[axis]]
        design[:, DELAY] = -gain * np.gradient(body[:, axis], samples.time_s)
        design[:, DRIFT], design[:, GYRO_SCALE] = turns * samples.since_s, turns * samples.turned
        # R'ᵀ (E' × e) of rotations e about north and east, which the tilt may be off by
        north = gain * (earth[2] * rotation[:, 1, axis] - seen[:, 1] * down[:, axis])
        east = gain * (seen[:, 0] * down[:, axis] - earth[2] * rotation[:, 0, axis])
        left.append(samples.field[:, axis] - gain * body[:, axis] + turns * error)
        designs.append(design)
        wanders.append(np.column_stack([turns, north, east]))
    return np.concatenate(left), np.vstack(designs), np.vstack(wanders)


def earth_change(earth: Array, world: Array) -> Array:
    """By how much a field is stronger than another in the horizontal and in the vertical, (2,)."""
    return np.array([math.hypot(*earth[:2]) - math.hypot(*world[:2]), earth[2] - world[2]])


def _first_error(rotation: Array, field: Array, world: Array) -> float:
    """Error of the heading by the first samples."""
    first = np.einsum("nij,nj->ni", rotation[:20], field[:20]).mean(axis=0)
    # true = Rz(error) · attitude
    return float(math.atan2(world[1], world[0]) - math.atan2(first[1], first[0]))
