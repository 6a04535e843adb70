"""Linear models of how the velocity error of a replay moves, as `linear_smoother` takes them.

Horizontal: states δv north and east, δθ, and where the measurement's error is correlated that of both axes; constants
are the errors of the gyro and accelerometer biases and of the measurement's delay. Vertical: δv down and the
measurement's correlated error; the tilt is known then, and one constant is left, the accelerometer's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.smoothing.error_model import ErrorModel
from fusetune.analyze.smoothing.inertial_steps import InertialSteps, Transitions, transitions
from fusetune.analyze.smoothing.linear_smoother import LinearModel, Smoothed

Array = npt.NDArray[np.float64]

FIRST_VELOCITY, FIRST_ROTATION = 1.0, (0.1, 0.1, 0.3)
"""Standard deviations of the errors that a stretch begins with, m/s and rad."""
GYRO_BIAS, ACCEL_BIAS, DELAY_S = 0.01, 0.3, 0.05
"""Standard deviations of the constants, rad/s, m/s² and s."""
ROTATION_TO_VELOCITY = 0.015 / 0.35
"""Walk of the attitude, rad/√s, for one of the velocity of 1 m/s/√s: as PX4's defaults of the noise of gyro and
accelerometer stand to each other."""

GYRO, ACCEL, DELAY = slice(0, 3), slice(3, 6), 6
CONSTANTS = 7


@dataclass(frozen=True)
class Stretch:
    """An uninterrupted part of a flight with its measurements.

    Attributes
    ----------
    sums : of its updates
    epoch : (N,) the updates at which there is a measurement
    measured : (N, 3) measured less estimated velocity, NED, m/s
    """

    sums: InertialSteps
    epoch: npt.NDArray[np.int64]
    measured: Array

    @property
    def step_s(self) -> Array:
        """(N − 1,) from one measurement to the next."""
        return np.asarray(np.diff(self.sums.time[self.epoch]) * 1e-6)

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


class HorizontalModel:
    """Models of one stretch for any noises; what does not depend on them is made once.

    Attributes
    ----------
    measured : (N, 2) measured less estimated velocity
    excess : (N, 2) factors on the variances of the measurements: 1, or more where one lies far off
    """

    def __init__(self, stretch: Stretch) -> None:
        self._step_s = stretch.step_s
        self.measured = stretch.measured[:, :2]
        self.excess = np.ones_like(self.measured)
        between, count = stretch.between, stretch.epoch.size
        self._transition = np.tile(np.eye(5), (count - 1, 1, 1))
        self._transition[:, :2, 2:] = between.velocity_by_rotation[:, :2]
        self._of_constants = np.zeros((count - 1, 5, CONSTANTS))
        self._of_constants[:, :2, GYRO] = between.velocity_by_gyro[:, :2]
        self._of_constants[:, :2, ACCEL] = -between.turned[:, :2]
        self._of_constants[:, 2:, GYRO] = -between.turned
        self._known = np.concatenate([between.known_velocity[:, :2], between.known_rotation], axis=1)
        self._observed = np.zeros((count, 2, CONSTANTS))
        self._observed[:, :, DELAY] = stretch.acceleration[:, :2]

    def __call__(self, errors: ErrorModel) -> LinearModel:
        walk = np.array([1.0, 1.0, *[ROTATION_TO_VELOCITY] * 3]) * errors.walk
        return _with_correlated_errors(
            LinearModel(
                transition=self._transition,
                of_constants=self._of_constants,
                known=self._known,
                process_variance=np.square(walk) * self._step_s[:, None],
                observation=np.eye(2, 5),
                observed_constants=self._observed,
                measured=self.measured,
                measurement_variance=self.excess * errors.white**2,
                first_variance=np.square([FIRST_VELOCITY, FIRST_VELOCITY, *FIRST_ROTATION]),
                constant_variance=np.square([*[GYRO_BIAS] * 3, *[ACCEL_BIAS] * 3, DELAY_S]),
            ),
            errors,
            self._step_s,
        )


class VerticalModel:
    """The same downwards, with attitude, biases and delay as the horizontal course has them."""

    def __init__(self, stretch: Stretch, horizontal: Smoothed) -> None:
        self._step_s = stretch.step_s
        between, constants = stretch.between, horizontal.constants
        rotation = horizontal.states[:-1, 2:5]
        known = np.einsum("kj,kj->k", between.velocity_by_rotation[:, 2], rotation)
        known += between.velocity_by_gyro[:, 2] @ constants[GYRO] + between.known_velocity[:, 2]
        self._known = (known - between.turned[:, 2] @ constants[ACCEL])[:, None]
        self.measured = stretch.measured[:, 2:] - stretch.acceleration[:, 2:] * constants[DELAY]
        self.excess = np.ones_like(self.measured)

    def __call__(self, errors: ErrorModel) -> LinearModel:
        count = self.measured.shape[0]
        return _with_correlated_errors(
            LinearModel(
                transition=np.ones((count - 1, 1, 1)),
                of_constants=-self._step_s[:, None, None],
                known=self._known,
                process_variance=errors.walk**2 * self._step_s[:, None],
                observation=np.ones((1, 1)),
                observed_constants=np.zeros((count, 1, 1)),
                measured=self.measured,
                measurement_variance=self.excess * errors.white**2,
                first_variance=np.array([FIRST_VELOCITY**2]),
                constant_variance=np.array([ACCEL_BIAS**2]),
            ),
            errors,
            self._step_s,
        )


def _with_correlated_errors(model: LinearModel, errors: ErrorModel, step_s: Array) -> LinearModel:
    """The model with a Gauss-Markov state for each measured axis, where the errors have one."""
    if errors.is_white:
        return model
    epochs, axes = model.measured.shape
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
        observation=np.hstack([model.observation, np.eye(axes)]),
        observed_constants=model.observed_constants,
        measured=model.measured,
        measurement_variance=model.measurement_variance,
        first_variance=np.r_[model.first_variance, np.full(axes, errors.correlated**2)],
        constant_variance=model.constant_variance,
    )
