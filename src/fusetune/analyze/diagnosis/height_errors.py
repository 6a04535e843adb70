"""What a barometer's height has that the vehicle's motion has not: wash, speed, nearness of the ground, time.

All four move the barometer by metres, and innovations of the height look alike. They are told apart by what they
follow: the thrust, the dynamic pressure along the axes of the body, the height above ground, or nothing but time. One
regression holds all of them against the height at once; its residuals wander, as barometers do, and its errors know it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.diagnosis.motion import Motion
from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.metrics.whitened_regression import Rows, generalised, order_of, runs
from fusetune.ekf2.numerics.constants import ONE_G

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

GROUND_SCALE_M = 1.5
"""Height over which the wash that the ground throws back falls to 1/e, for rotors of usual size."""
FASTEST_HZ = 10.0
AXES = ("forward", "backward", "sideways")


@dataclass(frozen=True)
class Effect:
    """What moves a height, with its standard error; `range_m` is by how much it did on this flight (5 to 95 %)."""

    value: float
    error: float
    range_m: float


@dataclass(frozen=True)
class HeightErrors:
    """What a height follows besides the height.

    Attributes
    ----------
    thrust : m for a thrust of once the weight
    speed : m for each metre of v²/2g, by direction (`AXES`); 1 is a hole that feels the whole dynamic pressure as
        suction
    ground : m at the ground, with the thrust of a hover, against far above
    drift : m/s
    samples, blocks : measurements, and independent parts of the flight behind the errors
    wind : (N, 2) at the times of the motion, north and east, m/s; None where it is not known
    """

    thrust: Effect
    speed: dict[str, Effect]
    ground: Effect
    drift: Effect
    samples: int
    blocks: int
    wind: Array | None = None

    def explained(self, time: Times, motion: Motion) -> Array:
        """(N,) m at some times: what it follows significantly but for time."""
        effects = (self.thrust, *(self.speed[axis] for axis in AXES), self.ground)
        sure = np.array([one.value if abs(one.value) > SIGMAS * one.error else 0.0 for one in effects])
        return np.asarray(_followed(time, motion, self.wind) @ sure)


SIGMAS = 3.0


def _followed(time: Times, motion: Motion, wind: Array | None) -> Array:
    """(N, 5) thrust, speed by direction, nearness of the ground."""
    velocity = motion.at(time, motion.air_velocity(wind))
    ahead = velocity[:, 0] * np.abs(velocity[:, 0]) / (2.0 * ONE_G)
    above, thrust = np.maximum(motion.at(time, motion.height), 0.0), motion.at(time, motion.thrust)
    return np.column_stack(
        [
            thrust,
            np.maximum(ahead, 0.0),
            np.maximum(-ahead, 0.0),
            velocity[:, 1] ** 2 / (2.0 * ONE_G),
            thrust * np.exp(-above / GROUND_SCALE_M),
        ]
    )


def height_errors(
    time: Times,
    height: Array,
    motion: Motion,
    intervals: tuple[Interval, ...],
    climbed: Array,
    wind: Array | None = None,
) -> HeightErrors | None:
    """The regression; None where there is too little of it.

    Parameters
    ----------
    time, height : (N,) µs, of the measurement, and m, up
    intervals : that count, µs
    climbed : (M,) height at the times of the motion, m, up, that owes little to this sensor
    wind : (M, 2) at the times of the motion, north and east, m/s; where it is not known speed over ground stands for
        speed through the air
    """
    usable = inside(time, intervals) & (time > motion.time[0]) & (time < motion.time[-1]) & np.isfinite(height)
    time, height = time[usable], height[usable]
    if time.size < 2:
        return None
    step_s = float(np.median(np.diff(time))) * 1e-6
    every = max(1, int(1.0 / (FASTEST_HZ * max(step_s, 1e-3)) + 0.5))
    time, height, step_s = time[::every], height[::every], step_s * every
    order = order_of(step_s)
    columns = np.column_stack([_followed(time, motion, wind), (time - time[0]) * 1e-6])
    left = height - motion.at(time, climbed)
    rows = [
        Rows(
            np.diff(left[part])[:, None],
            np.diff(columns[part], axis=0)[:, None, :],
            np.asarray(time[part][1:] * 1e-6, np.float64),
        )
        for part in runs(time)
        if part.stop - part.start > 2 * order + 2
    ]
    if not rows:
        return None
    fit = generalised(rows, order)
    errors = fit.standard_errors()
    if errors is None:
        return None
    error, blocks = errors
    promised = fit.promised_errors()
    # take-off and landing are one event each: leaving a block out leaves nothing
    error[[0, 4]] = np.maximum(promised[[0, 4]], 0.3 * error[[0, 4]])
    spans = np.ptp(np.percentile(columns, [5, 95], axis=0), axis=0)
    # the ground is left and met again within seconds
    spans[4] = np.ptp(columns[:, 4])
    found = [
        Effect(float(value), float(one), float(abs(value) * span))
        for value, one, span in zip(fit.solution, error, spans, strict=True)
    ]
    speed = dict(zip(AXES, found[1:4], strict=True))
    return HeightErrors(found[0], speed, found[4], found[5], time.size, blocks, wind)
