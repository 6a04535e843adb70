"""The true motion of the vehicle, sampled at the rate at which its inertial sensors are read.

Position, velocity and acceleration come in the tangent frame at home (`earth.TangentFrame`), which is fixed to the
earth. Attitude follows from the motion: the rotors push along the body's z axis, so that axis points along the force
that is left when gravity, the earth's rotation and drag have had their part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import cont2discrete, lfilter, ss2tf
from scipy.spatial.transform import Rotation

from fusetune.execute.vehicle import Airframe, Vehicle
from fusetune.execute.world.earth import TangentFrame
from fusetune.execute.world.flight_plan import FlightEvents, FlightPlan
from fusetune.execute.world.wind import gusts, mean_wind

GROUND_TRANSITION_S = 1.5
"""From standing on the ground to hanging on the rotors, and back."""
SPIN_UP_S = 0.6
THRUST_RAMP_S = 0.8
STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True)
class Truth:
    """True motion at N instants."""

    frame: TangentFrame
    events: FlightEvents
    timestamp_us: np.ndarray
    """(N,) int64, evenly spaced."""
    position: np.ndarray
    """(N, 3) m, tangent frame."""
    velocity: np.ndarray
    acceleration: np.ndarray
    attitude: Rotation
    """Body to tangent frame, N rotations."""
    specific_force: np.ndarray
    """(N, 3) m/s², body: what an ideal accelerometer feels."""
    rotation_increments: np.ndarray
    """(N - 1, 3) rad: rotation vector of the body against inertial space from one instant to the next."""
    rotor_speed: np.ndarray
    """(N,) rotor speed over that at hover."""
    wind: np.ndarray
    """(N, 3) m/s, tangent frame."""

    @property
    def time_s(self) -> np.ndarray:
        """Seconds since boot, (N,)."""
        return self.timestamp_us * 1e-6

    @property
    def after_takeoff_s(self) -> np.ndarray:
        """Seconds since take-off, (N,)."""
        return self.time_s - self.events.takeoff_s

    @property
    def step_s(self) -> float:
        """Seconds between two instants."""
        return float(self.timestamp_us[1] - self.timestamp_us[0]) * 1e-6

    def at(self, timestamp_us: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Values (N,) or (N, D) of the truth at other times; the first and last hold outside."""
        if values.ndim == 1:
            return np.interp(timestamp_us, self.timestamp_us, values)
        return np.stack([np.interp(timestamp_us, self.timestamp_us, column) for column in values.T], axis=-1)

    def attitude_at(self, timestamp_us: np.ndarray) -> Rotation:
        """Attitude at other times.

        Between two instants, a fraction of a degree apart, the quaternion is interpolated linearly.
        """
        index = np.clip(
            np.searchsorted(self.timestamp_us, timestamp_us, side="right") - 1, 0, len(self.timestamp_us) - 2
        )
        span = self.timestamp_us[index + 1] - self.timestamp_us[index]
        share = np.clip((timestamp_us - self.timestamp_us[index]) / span, 0.0, 1.0)[:, None]
        first, second = self.attitude[index].as_quat(), self.attitude[index + 1].as_quat()
        second = np.where(np.sum(first * second, axis=1, keepdims=True) < 0.0, -second, second)
        return Rotation.from_quat((1.0 - share) * first + share * second)

    def body_rate_at(self, timestamp_us: np.ndarray) -> np.ndarray:
        """Angular velocity of the body against the earth at other times, body frame, (M, 3) rad/s."""
        half = self.timestamp_us[1] - self.timestamp_us[0]
        before, after = self.attitude_at(timestamp_us - half), self.attitude_at(timestamp_us + half)
        return np.asarray((before.inv() * after).as_rotvec() / (2e-6 * half))


def simulate_truth(plan: FlightPlan, vehicle: Vehicle, seed: int) -> Truth:
    """Fly the plan: gusts push the vehicle off it, its position control brings it back."""
    events = plan.events
    step_us = 1_000_000 // vehicle.imu.raw_rate_hz
    first_us = round(events.log_start_s * 1e6)
    timestamp_us = np.arange(first_us, round(events.end_s * 1e6) + step_us, step_us, dtype=np.int64)
    time_s = timestamp_us * 1e-6
    lift = _lift(time_s, events)

    planned_velocity = plan.path.evaluate(time_s, 1)
    height_m, cruise_m_s = _typical_height_and_speed(plan)
    steady_wind = mean_wind(vehicle.environment)
    gust = gusts(vehicle.environment, time_s, height_m, cruise_m_s, seed)
    steady_drag = _drag(vehicle.airframe, planned_velocity - steady_wind)
    drag = _drag(vehicle.airframe, planned_velocity - steady_wind - gust)
    pushed = _gust_response(vehicle.airframe, drag - steady_drag, lift, step_us * 1e-6)

    position = plan.path.evaluate(time_s) + pushed[0]
    velocity = planned_velocity + pushed[1]
    acceleration = plan.path.evaluate(time_s, 2) + pushed[2]
    force = acceleration + 2.0 * np.cross(plan.frame.earth_rate, velocity) - plan.frame.gravity(position)
    thrust = force - drag
    yaw = plan.yaw.evaluate(time_s)[:, 0]
    attitude = _attitude(vehicle.airframe, thrust, yaw, lift[0])
    return Truth(
        frame=plan.frame,
        events=events,
        timestamp_us=timestamp_us,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        attitude=attitude,
        specific_force=np.asarray(attitude.inv().apply(force)),
        rotation_increments=_rotation_increments(attitude, plan.frame.earth_rate, step_us * 1e-6),
        rotor_speed=_rotor_speed(vehicle.airframe, np.linalg.norm(thrust, axis=1), time_s, events),
        wind=steady_wind + gust,
    )


def _typical_height_and_speed(plan: FlightPlan) -> tuple[float, float]:
    lengths = np.linalg.norm(np.diff(plan.path.knots, axis=0), axis=1)
    speeds = lengths / np.diff(plan.path.times_s)
    return float(-plan.path.knots[:, 2].min()), float(speeds.max())


def _lift(time_s: np.ndarray, events: FlightEvents) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How far the vehicle hangs on its rotors (0 on the ground, 1 in flight), with first and second derivative."""
    rising = _smooth_step((time_s - events.takeoff_s) / GROUND_TRANSITION_S)
    falling = _smooth_step((events.touchdown_s - time_s) / GROUND_TRANSITION_S)
    in_first_half = time_s < 0.5 * (events.takeoff_s + events.touchdown_s)
    value, slope, curvature = (np.where(in_first_half, up, down) for up, down in zip(rising, falling, strict=True))
    sign = np.where(in_first_half, 1.0, -1.0)
    return value, sign * slope / GROUND_TRANSITION_S, curvature / GROUND_TRANSITION_S**2


def _smooth_step(share: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Polynomial from 0 to 1 with three vanishing derivatives at both ends, and its first two derivatives."""
    x = np.clip(share, 0.0, 1.0)
    value = x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)
    return value, 140.0 * x**3 * (1.0 - x) ** 3, 420.0 * x**2 * (1.0 - x) ** 2 * (1.0 - 2.0 * x)


def _drag(airframe: Airframe, velocity_through_air: np.ndarray) -> np.ndarray:
    """Acceleration by drag, (N, 3): rotor drag grows with speed, body drag with its square."""
    speed = np.linalg.norm(velocity_through_air, axis=1, keepdims=True)
    return np.asarray(-(airframe.linear_drag_1_s + airframe.quadratic_drag_1_m * speed) * velocity_through_air)


def _gust_response(
    airframe: Airframe, push: np.ndarray, lift: tuple[np.ndarray, np.ndarray, np.ndarray], step_s: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Displacement by gusts with its first two derivatives, each (N, 3).

    Position control answers like a damped spring. The push is taken as linear between samples, for which the
    discrete system is exact, so that the three outputs are derivatives of each other. On the ground nothing moves.
    """
    stiffness, damping = airframe.gust_response_rad_s**2, 2.0 * airframe.gust_damping * airframe.gust_response_rad_s
    system = (
        np.array([[0.0, 1.0], [-stiffness, -damping]]),
        np.array([[0.0], [1.0]]),
        np.array([[1.0, 0.0], [0.0, 1.0], [-stiffness, -damping]]),
        np.array([[0.0], [0.0], [1.0]]),
    )
    numerators, denominator = ss2tf(*cont2discrete(system, step_s, method="foh")[:4])
    held = push * lift[0][:, None]
    moved, speed, acceleration = (np.asarray(lfilter(row, denominator, held, axis=0)) for row in numerators)
    hold, slope, curvature = (part[:, None] for part in lift)
    return (
        hold * moved,
        slope * moved + hold * speed,
        curvature * moved + 2.0 * slope * speed + hold * acceleration,
    )


def _attitude(airframe: Airframe, thrust: np.ndarray, yaw: np.ndarray, lift: np.ndarray) -> Rotation:
    """Attitude that points the rotors along the thrust in flight, and stands on its legs on the ground."""
    down = -thrust / np.linalg.norm(thrust, axis=1, keepdims=True)
    heading = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=-1)
    right = np.cross(down, heading)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    forward = np.cross(right, down)
    flying = Rotation.from_matrix(np.stack([forward, right, down], axis=-1))
    tilt = (math.radians(airframe.ground_pitch_deg), math.radians(airframe.ground_roll_deg))
    angles = np.stack([yaw, np.full_like(yaw, tilt[0]), np.full_like(yaw, tilt[1])], axis=-1)
    standing = Rotation.from_euler("ZYX", angles)
    return standing * Rotation.from_rotvec((standing.inv() * flying).as_rotvec() * lift[:, None])


def _rotation_increments(attitude: Rotation, earth_rate: np.ndarray, step_s: float) -> np.ndarray:
    """Rotation against inertial space in each step: that of the body in the frame, and of the frame with the earth."""
    earth_turn = Rotation.from_rotvec(earth_rate * step_s)
    return np.asarray((attitude[:-1].inv() * earth_turn * attitude[1:]).as_rotvec())


def _rotor_speed(airframe: Airframe, thrust: np.ndarray, time_s: np.ndarray, events: FlightEvents) -> np.ndarray:
    """Rotor speed over that at hover: thrust grows with its square."""
    flying = np.sqrt(thrust / STANDARD_GRAVITY_M_S2)
    idle = airframe.idle_throttle / airframe.hover_throttle
    spun_up = np.clip((time_s - events.armed_s) / SPIN_UP_S, 0.0, 1.0)
    spun_down = np.clip((events.disarmed_s - time_s) / SPIN_UP_S, 0.0, 1.0)
    standing = idle * np.minimum(spun_up, spun_down)
    ramped_up = np.clip((time_s - events.takeoff_s + THRUST_RAMP_S) / THRUST_RAMP_S, 0.0, 1.0)
    ramped_down = np.clip((events.touchdown_s + THRUST_RAMP_S - time_s) / THRUST_RAMP_S, 0.0, 1.0)
    share = np.minimum(ramped_up, ramped_down)
    return np.asarray(standing + share * (flying - standing))
