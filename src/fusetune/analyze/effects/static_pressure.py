"""Static pressure error of the airflow over the vehicle: `EKF2_PCOEF_XP`, `_XN`, `_YP`, `_YN`, `_Z`.

The model is the filter's own (`ekf2/filter/aid_sources/barometer/static_pressure.py`): the barometer reads low by
½ Σ K_i v_i² / g, v the air velocity in the body. It is compared with the height that IMU and GNSS vertical velocity
tell; what both wander is a walk. The wind is that of the drag fit, with what that may be off by (`wind_errors`) as
constants beside the coefficients, or, where that does not tell it, a constant one of some metres per second.

The rotors' wash raises and lowers the pressure with the thrust, and a fast vehicle flies with more of it; so a share of
the thrust is estimated beside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.effects.drag import DragFit, fit_drag
from fusetune.analyze.effects.estimate import Effect
from fusetune.analyze.effects.told import NO_MOTION, barometer_rows, estimate_of, refused
from fusetune.analyze.effects.walking_regression import WalkingFit, WalkingRows, fit_walking
from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.observed.body_motion import BodyMotion
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.numerics.constants import ONE_G

Array = npt.NDArray[np.float64]

DIRECTIONS = ("XP", "XN", "YP", "YN", "Z")
WASH_M_PER_G = 0.5
"""Standard deviation beforehand of what one g more of thrust does to the barometer, m."""
UNKNOWN_WIND_M_S = 3.0
"""Standard deviation beforehand, north and east, of a wind that the drag does not tell."""
LARGEST_ERROR = 0.1
"""Standard error of a coefficient above which it is not told; PX4 takes −0.5 to 0.5."""
LEAST_SPEED_M_S = 3.0
WASH = len(DIRECTIONS)
"""Place of the wash among the constants."""
_LARGEST, _FARTHEST_OFF = 1.0, 3.0
"""Of coefficients and of the wind, in its standard errors, from one round to the next."""
_ROUNDS = 4
_KNOTS_S = 2.0
_FEWEST = 300
_WHAT_TO_FLY = (
    "fly forward, backward, left and right between rest and full speed at constant height, several times each, in"
    " still air, with good GNSS"
)


def estimate_static_pressure(observed: ObservedFlight, fitted: DragFit | str | None = None) -> Effect:
    """Coefficients per direction of the air.

    Parameters
    ----------
    fitted : by `drag.fit_drag`, where it is at hand
    """
    motion, name = observed.motion, "static_pressure"
    rows = barometer_rows(observed)
    if motion is None or rows is None:
        return refused(
            name, NO_MOTION if motion is None else "the log has no barometer that measures (`vehicle_air_data`)"
        )
    time, altitude = rows
    used = inside(time, observed.clear_of_ground)
    if np.count_nonzero(used) < _FEWEST:
        return refused(name, f"too short a time in the air away from the ground; {_WHAT_TO_FLY}")
    time, altitude = time[used], altitude[used]
    fitted = fit_drag(observed) if fitted is None else fitted
    limit = observed.parameters.get("EKF2_ASPD_MAX", 20.0) ** 2
    through = _ThroughAir.of(motion, time, fitted if isinstance(fitted, DragFit) else None, limit)
    figures = {
        "wind_known": float(isinstance(fitted, DragFit)),
        "fastest_m_s": float(np.max(np.abs(through.air()[:, :2]))),
        "by_gnss": float(motion.by_gnss),
    }
    if figures["fastest_m_s"] < LEAST_SPEED_M_S:
        told = f"the fastest air along the body is {figures['fastest_m_s']:.1f} m/s; {_WHAT_TO_FLY}"
        return refused(name, told, **figures)
    thrust = motion.at(time, -motion.specific_force[:, 2:])[:, 0] / ONE_G - 1.0
    target = altitude - motion.at(time, motion.height[:, None])[:, 0]
    fit = _gauss_newton(np.asarray(time * 1e-6, np.float64), target, thrust, through)
    if fit is None:
        return refused(name, f"too short a time in the air away from the ground; {_WHAT_TO_FLY}", **figures)
    figures |= {"noise_m": fit.noise, "walk_m_sqrt_s": fit.walk, "wash_m_per_g": float(fit.constants[WASH])}
    figures["wash_error_m_per_g"] = float(fit.standard_error[WASH])
    names = [f"EKF2_PCOEF_{one}" for one in DIRECTIONS]
    known = [index for index in range(len(names)) if fit.standard_error[index] <= LARGEST_ERROR]
    estimates = tuple(estimate_of(fit, one, names[one], "", observed.parameters.get(names[one])) for one in known)
    missing = ", ".join(names[one] for one in range(len(names)) if one not in known)
    refusal = f"{missing} not told: too little air from there; {_WHAT_TO_FLY}" if missing else ""
    return Effect(name, estimates, refusal, figures)


@dataclass(frozen=True)
class _ThroughAir:
    """How the vehicle moves through the air at N times, and how the wind may be off.

    Attributes
    ----------
    rotation : (N, 3, 3) body → NED
    velocity : (N, 3) less the wind, NED, m/s
    wind_errors : (N, 2, Q) of `DragFit.wind_errors`, or of a wind of which nothing is known
    limit : of squares of air velocities, m²/s²
    """

    rotation: Array
    velocity: Array
    wind_errors: Array
    limit: float

    @classmethod
    def of(cls, motion: BodyMotion, time: npt.NDArray[np.int64], fitted: DragFit | None, limit: float) -> _ThroughAir:
        velocity, time_s = motion.at(time, motion.velocity), np.asarray(time * 1e-6, np.float64)
        if fitted is None:
            errors = np.broadcast_to(UNKNOWN_WIND_M_S * np.eye(2), (time.size, 2, 2))
        else:
            velocity[:, :2] -= fitted.wind(time_s)
            errors = fitted.wind_errors(time_s)
        return cls(motion.at(time, motion.rotation), velocity, errors, limit)

    def air(self, off: Array | None = None) -> Array:
        """(N, 3) air velocity, body, m/s, where the wind is off by (Q,) times its errors."""
        velocity = self.velocity.copy()
        if off is not None:
            velocity[:, :2] -= self.wind_errors @ off
        return np.asarray(np.einsum("nji,nj->ni", self.rotation, velocity))

    def by_wind(self, air: Array, coefficients: Array) -> Array:
        """(N, Q) m, by how much the barometer's height changes with what the wind is off by."""
        ahead, right = air[:, 0] >= 0.0, air[:, 1] >= 0.0
        forward, backward, rightward, leftward, vertical = coefficients
        shares = np.column_stack([
            np.where(ahead, forward, backward), np.where(right, rightward, leftward), np.full(air.shape[0], vertical),
        ])  # fmt: skip
        slope = np.where(np.square(air) < self.limit, shares * air / ONE_G, 0.0)
        return np.asarray(np.einsum("nj,nwj,nwq->nq", slope, self.rotation[:, :2], self.wind_errors))


def _gauss_newton(time_s: Array, target: Array, thrust: Array, through: _ThroughAir) -> WalkingFit | None:
    """Coefficients, wash, and what the wind of the drag fit is off by."""
    coefficients, off = np.zeros(len(DIRECTIONS)), np.zeros(through.wind_errors.shape[2])
    expected = np.array([*[0.5] * len(DIRECTIONS), WASH_M_PER_G, *[1.0] * off.size])
    fit: WalkingFit | None = None
    for number in range(_ROUNDS):
        air = through.air(off)
        by_wind = through.by_wind(air, coefficients)
        design = np.column_stack([pressure_heights(air, through.limit), thrust, by_wind])
        rows = WalkingRows(time_s, target + by_wind @ off, design, np.ones((time_s.size, 1)), expected, _KNOTS_S)
        fit = fit_walking(rows, fit, refined=number == 1)
        if fit is None:
            return None
        coefficients = np.clip(fit.constants[: len(DIRECTIONS)], -_LARGEST, _LARGEST)
        off = np.clip(fit.constants[WASH + 1 :], -_FARTHEST_OFF, _FARTHEST_OFF)
    return fit


def pressure_heights(air: Array, limit: float) -> Array:
    """What a coefficient of 1 adds to the barometer's height, (N, 5) m, in the order of `DIRECTIONS`.

    Parameters
    ----------
    air : (N, 3) air velocity, body, m/s
    limit : of its squares, m²/s²
    """
    height = -0.5 * np.minimum(np.square(air), limit) / ONE_G
    x, y, z = height.T
    ahead, right = air[:, 0] >= 0.0, air[:, 1] >= 0.0
    return np.column_stack([x * ahead, x * ~ahead, y * right, y * ~right, z])
