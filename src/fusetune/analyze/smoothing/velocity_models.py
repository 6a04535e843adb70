"""Linear models of how the velocity error of a replay moves, as `linear_smoother` takes them.

Horizontal: states δv north and east, and δθ; constants are the errors of the gyro and accelerometer biases, of the
measurement's delay and, where it is asked for, of the place of its sensor. Vertical: δv down; the attitude is known
then, and the accelerometer's constant is left, with the place. With each series of positions or heights goes a state
per axis, the integral of δv and a walk, as the errors of both wander for minutes. Where the error of the velocity
measurement is correlated, it is a state, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fusetune.analyze.smoothing.error_model import ErrorModel, PositionErrors
from fusetune.analyze.smoothing.inertial_steps import InertialSteps, Transitions, transitions
from fusetune.analyze.smoothing.linear_smoother import Likelihood, LinearModel, Smoothed
from fusetune.analyze.smoothing.noise_terms import GaussMarkov, NoiseTerms

Array = npt.NDArray[np.float64]

PLANE, DOWN = (0, 1), (2,)
"""Axes that a series of positions or heights has."""

FIRST_VELOCITY, FIRST_ROTATION, FIRST_POSITION = 1.0, (0.1, 0.1, 0.3), 10.0
"""Standard deviations of the errors that a stretch begins with, m/s, rad and m."""
GYRO_BIAS, ACCEL_BIAS, DELAY_S, ARM_M = 0.01, 0.3, 0.05, 0.3
"""Standard deviations of the constants, rad/s, m/s², s and m."""
ROTATION_TO_VELOCITY = 0.015 / 0.35
"""Walk of the attitude, rad/√s, for one of the velocity of 1 m/s/√s: as PX4's defaults of the noise of gyro and
accelerometer stand to each other."""

GYRO, ACCEL, DELAY, ARM = slice(0, 3), slice(3, 6), 6, slice(7, 10)
CONSTANTS = 7
"""Of the horizontal model; the place of the sensor, if it is one of them, comes behind them."""
VERTICAL_ARM = slice(1, 4)


@dataclass(frozen=True)
class PositionSeries:
    """Measured positions or heights less the integral of the estimated velocity.

    Attributes
    ----------
    source : aid source
    axes : `PLANE` or `DOWN`
    values : (N, 2 or 1) at each epoch, NED, m; NaN where there is none
    is_delayed : whether it comes with the velocity and so shares the error of its delay
    """

    source: str
    axes: tuple[int, ...]
    values: Array
    is_delayed: bool


@dataclass(frozen=True)
class Stretch:
    """An uninterrupted part of a flight with its measurements.

    Attributes
    ----------
    sums : of its updates
    epoch : (N,) the updates at which the velocity is measured
    measured : (N, 3) measured less estimated velocity, NED, m/s
    positions : what else is measured
    swing : (N, 3, 3) R [ω]×, what a metre of lever arm along each axis of the body adds to the measured velocity,
        NED, 1/s; None where the place of the sensor is taken as known
    """

    sums: InertialSteps
    epoch: npt.NDArray[np.int64]
    measured: Array
    positions: tuple[PositionSeries, ...] = ()
    swing: Array | None = None

    @property
    def between(self) -> Transitions:
        """Of the errors, from each measurement to the next."""
        return transitions(self.sums, self.epoch[:-1], self.epoch[1:])

    @property
    def acceleration(self) -> Array:
        """(N, 3) mean from the measurement before to the one after, m/s²."""
        updates = np.r_[self.epoch[0], self.epoch, self.epoch[-1]]
        gained = np.cumsum(self.sums.acceleration, axis=0)
        count = np.maximum(updates[2:] - updates[:-2], 1)[:, None]
        return np.asarray((gained[updates[2:]] - gained[updates[:-2]]) / count)


@dataclass(frozen=True)
class _Motion:
    """What of a model does not depend on the noises: A axes, n states of the inertial solution (δv first), m constants.

    Attributes
    ----------
    step_s : (N − 1,)
    transition, of_constants, known : (N − 1, …) of the states, as in `LinearModel`
    walk : (n,) of each state for a velocity that walks with 1 m/s/√s
    position_by_state, position_by_constants, known_position : (N − 1, A, …) growth of the integrated velocity's error
    delay : (N, 2, A, m) what the constants do to a measured velocity and to a measured position of its source
    first, constants : standard deviations
    """

    step_s: Array
    transition: Array
    of_constants: Array
    known: Array
    walk: Array
    position_by_state: Array
    position_by_constants: Array
    known_position: Array
    delay: Array
    first: Array
    constants: Array


class VelocityModel:
    """Models of some axes of one stretch for any noises.

    Attributes
    ----------
    measured : (N, p) the velocity's axes first, then those of each series of positions; 0 where there is none
    excess : (N, p) factors on the variances of the measurements: 1, more where one lies far off, infinite where there
        is none
    axes : number of axes, A
    series : number of series of positions
    """

    def __init__(self, motion: _Motion, velocity: Array, positions: Sequence[PositionSeries]) -> None:
        self._motion, self._delayed = motion, [one.is_delayed for one in positions]
        self.axes, self.series = velocity.shape[1], len(positions)
        values = np.hstack([velocity, *(one.values for one in positions)])
        self.excess = np.where(np.isfinite(values), 1.0, np.inf)
        self.measured = np.nan_to_num(values)
        self._parts = self._with_positions()
        self._terms: dict[bool, NoiseTerms] = {}

    @property
    def measurements(self) -> int:
        """How many there are of all axes."""
        return int(np.count_nonzero(np.isfinite(self.excess)))

    def likelihood(self, errors: ErrorModel) -> Likelihood:
        """Of all measurements under these noises; `excess` must stay from the first call on."""
        if errors.is_white not in self._terms:
            self._terms[errors.is_white] = self._noise_terms(errors.is_white)
        terms = self._terms[errors.is_white]
        noises = [errors.walk, *(one.walk for one in errors.positions)]
        noises += [errors.white, *(one.white for one in errors.positions)]
        markov = None
        if not errors.is_white:
            kept = np.exp(-self._motion.step_s / errors.correlation_time_s)
            markov = GaussMarkov(self.axes, errors.correlated**2, kept)
        return terms.likelihood(np.square(noises).tolist(), markov)

    def _noise_terms(self, is_white: bool) -> NoiseTerms:
        unit = ErrorModel(1.0, 1.0, 0.0 if is_white else 1.0, 1.0, (PositionErrors(1.0, 1.0),) * self.series)
        model, axes, size = self(unit), self.axes, self._motion.walk.size
        if not is_white:
            moves = model.transition.copy()
            moves[:, range(-axes, 0), range(-axes, 0)] = 0.0
            model = replace(model, transition=moves)
        states = [slice(0, size), *(slice(size + axes * i, size + axes * (i + 1)) for i in range(self.series))]
        rows = [slice(axes * i, axes * (i + 1)) for i in range(1 + self.series)]
        return NoiseTerms(model, states, rows, 0 if is_white else axes)

    def _with_positions(self) -> dict[str, Array]:
        """Transition, constants and observation with the states of the series behind those of the motion."""
        motion, axes = self._motion, self.axes
        steps, size, constants = motion.of_constants.shape
        total = size + axes * self.series
        transition = np.zeros((steps, total, total))
        transition[:, range(total), range(total)] = 1.0
        transition[:, :size, :size] = motion.transition
        of_constants, known = np.zeros((steps, total, constants)), np.zeros((steps, total))
        of_constants[:, :size], known[:, :size] = motion.of_constants, motion.known
        observation = np.zeros((axes * (1 + self.series), total))
        observation[:axes, :axes] = np.eye(axes)
        observed = np.zeros((steps + 1, axes * (1 + self.series), constants))
        observed[:, :axes] = motion.delay[:, 0]
        for number, is_delayed in enumerate(self._delayed):
            state = slice(size + axes * number, size + axes * (number + 1))
            row = slice(axes * (number + 1), axes * (number + 2))
            transition[:, state, :size] = motion.position_by_state
            of_constants[:, state], known[:, state] = motion.position_by_constants, motion.known_position
            observation[row, state] = np.eye(axes)
            if is_delayed:
                observed[:, row] = motion.delay[:, 1]
        return {
            "transition": transition, "of_constants": of_constants, "known": known,
            "observation": observation, "observed_constants": observed,
        }  # fmt: skip

    def __call__(self, errors: ErrorModel) -> LinearModel:
        """The model under these noises."""
        motion, axes = self._motion, self.axes
        walk = np.r_[motion.walk * errors.walk, np.repeat([one.walk for one in errors.positions], axes)]
        white = np.repeat([errors.white, *(one.white for one in errors.positions)], axes)
        model = LinearModel(
            **self._parts,
            process_variance=np.square(walk) * motion.step_s[:, None],
            measured=self.measured,
            measurement_variance=self.excess * np.square(white),
            first_variance=np.square(np.r_[motion.first, np.full(axes * self.series, FIRST_POSITION)]),
            constant_variance=np.square(motion.constants),
        )
        return model if errors.is_white else _with_correlated_errors(model, errors, motion.step_s, axes)


def horizontal_model(stretch: Stretch) -> VelocityModel:
    """North and east, with the attitude and all constants."""
    between, steps = stretch.between, stretch.epoch.size - 1
    arm_m = _arm_m(stretch)
    passed_s = between.passed_s[:, None, None]
    transition = np.tile(np.eye(5), (steps, 1, 1))
    transition[:, :2, 2:] = between.velocity_by_rotation[:, :2]
    of_constants = np.zeros((steps, 5, CONSTANTS + len(arm_m)))
    of_constants[:, :2, GYRO] = between.velocity_by_gyro[:, :2]
    of_constants[:, :2, ACCEL] = -between.turned[:, :2]
    of_constants[:, 2:, GYRO] = -between.turned
    delay = np.zeros((steps + 1, 2, 2, CONSTANTS + len(arm_m)))
    delay[:, 0, :, DELAY] = stretch.acceleration[:, :2]
    delay[:, 1, :, DELAY] = stretch.sums.velocity[stretch.epoch, :2]
    if stretch.swing is not None:
        delay[:, 0, :, ARM] = stretch.swing[:, :2]
    motion = _Motion(
        step_s=between.passed_s,
        transition=transition,
        of_constants=of_constants,
        known=np.concatenate([between.known_velocity[:, :2], between.known_rotation], axis=1),
        walk=np.array([1.0, 1.0, *[ROTATION_TO_VELOCITY] * 3]),
        position_by_state=np.concatenate([passed_s * np.eye(2), between.position_by_rotation[:, :2]], axis=2),
        position_by_constants=0.5 * passed_s * of_constants[:, :2],
        known_position=between.known_position[:, :2],
        delay=delay,
        first=np.array([FIRST_VELOCITY, FIRST_VELOCITY, *FIRST_ROTATION]),
        constants=np.array([*[GYRO_BIAS] * 3, *[ACCEL_BIAS] * 3, DELAY_S, *arm_m]),
    )
    return VelocityModel(motion, stretch.measured[:, :2], [one for one in stretch.positions if one.axes == PLANE])


def vertical_model(stretch: Stretch, horizontal: Smoothed) -> VelocityModel:
    """Down, with attitude, biases and delay as the horizontal course has them."""
    between, constants = stretch.between, horizontal.constants
    passed_s, rotation = between.passed_s, horizontal.states[:-1, 2:5]
    by_constants = between.velocity_by_gyro[:, 2] @ constants[GYRO] - between.turned[:, 2] @ constants[ACCEL]
    known = np.einsum("kj,kj->k", between.velocity_by_rotation[:, 2], rotation)
    known_position = np.einsum("kj,kj->k", between.position_by_rotation[:, 2], rotation)
    measured = stretch.measured[:, 2:] - stretch.acceleration[:, 2:] * constants[DELAY]
    arm_m = _arm_m(stretch)
    delay = np.zeros((stretch.epoch.size, 2, 1, 1 + len(arm_m)))
    if stretch.swing is not None:
        delay[:, 0, :, VERTICAL_ARM] = stretch.swing[:, 2:]
    of_constants = np.zeros((passed_s.size, 1, 1 + len(arm_m)))
    of_constants[:, 0, 0] = -passed_s
    motion = _Motion(
        step_s=passed_s,
        transition=np.ones((passed_s.size, 1, 1)),
        of_constants=of_constants,
        known=(known + by_constants + between.known_velocity[:, 2])[:, None],
        walk=np.ones(1),
        position_by_state=passed_s[:, None, None],
        position_by_constants=0.5 * passed_s[:, None, None] * of_constants,
        known_position=(known_position + 0.5 * passed_s * by_constants + between.known_position[:, 2])[:, None],
        delay=delay,
        first=np.array([FIRST_VELOCITY]),
        constants=np.array([ACCEL_BIAS, *arm_m]),
    )
    return VelocityModel(motion, measured, [one for one in stretch.positions if one.axes == DOWN])


def _arm_m(stretch: Stretch) -> list[float]:
    """Standard deviations of the place of the sensor, where it is asked for."""
    return [] if stretch.swing is None else [ARM_M] * 3


def _with_correlated_errors(model: LinearModel, errors: ErrorModel, step_s: Array, axes: int) -> LinearModel:
    """The model with a Gauss-Markov state for the error of each measured axis of the velocity."""
    epochs, rows = model.measured.shape
    size = model.observation.shape[1]
    kept = np.exp(-step_s / errors.correlation_time_s)
    transition = np.zeros((epochs - 1, size + axes, size + axes))
    transition[:, :size, :size] = model.transition
    transition[:, range(size, size + axes), range(size, size + axes)] = kept[:, None]
    new = np.tile((errors.correlated**2 * -np.expm1(-2.0 * step_s / errors.correlation_time_s))[:, None], (1, axes))
    return LinearModel(
        transition=transition,
        of_constants=np.pad(model.of_constants, ((0, 0), (0, axes), (0, 0))),
        known=np.pad(model.known, ((0, 0), (0, axes))),
        process_variance=np.hstack([model.process_variance, new]),
        observation=np.hstack([model.observation, np.eye(rows, axes)]),
        observed_constants=model.observed_constants,
        measured=model.measured,
        measurement_variance=model.measurement_variance,
        first_variance=np.r_[model.first_variance, np.full(axes, errors.correlated**2)],
        constant_variance=model.constant_variance,
    )
