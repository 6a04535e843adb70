"""Static pressure error of the airflow over the vehicle: `EKF2_PCOEF_XP`, `_XN`, `_YP`, `_YN`, `_Z`.

The model is the filter's own (`ekf2/filter/aid_sources/barometer/static_pressure.py`): the barometer reads low by
½ Σ K_i v_i² / g, v the air velocity in the body. It is compared with the height that IMU and GNSS vertical velocity
tell; what both wander is a walk. The wind is that of the drag fit or, where that does not tell it, none.

The rotors' wash raises and lowers the pressure with the thrust, and a fast vehicle flies with more of it; so a share of
the thrust is estimated beside.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fusetune.analyze.effects.drag import DragFit, fit_drag
from fusetune.analyze.effects.estimate import Effect
from fusetune.analyze.effects.told import NO_MOTION, barometer_rows, estimate_of, refused
from fusetune.analyze.effects.walking_regression import WalkingRows, fit_walking
from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.numerics.constants import ONE_G

Array = npt.NDArray[np.float64]

DIRECTIONS = ("XP", "XN", "YP", "YN", "Z")
WASH_M_PER_G = 0.5
"""Standard deviation beforehand of what one g more of thrust does to the barometer, m."""
LARGEST_ERROR = 0.1
"""Standard error of a coefficient above which it is not told; PX4 takes −0.5 to 0.5."""
LEAST_SPEED_M_S = 3.0
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
    time_s = np.asarray(time * 1e-6, np.float64)
    velocity = motion.at(time, motion.velocity)
    fitted = fit_drag(observed) if fitted is None else fitted
    if isinstance(fitted, DragFit):
        velocity[:, :2] -= fitted.wind(time_s)
    air = np.einsum("nji,nj->ni", motion.at(time, motion.rotation), velocity)
    figures = {
        "wind_known": float(isinstance(fitted, DragFit)),
        "fastest_m_s": float(np.max(np.abs(air[:, :2]))),
        "by_gnss": float(motion.by_gnss),
    }
    if figures["fastest_m_s"] < LEAST_SPEED_M_S:
        told = f"the fastest air along the body is {figures['fastest_m_s']:.1f} m/s; {_WHAT_TO_FLY}"
        return refused(name, told, **figures)
    limit = observed.parameters.get("EKF2_ASPD_MAX", 20.0) ** 2
    thrust = motion.at(time, -motion.specific_force[:, 2:])[:, 0] / ONE_G - 1.0
    design = np.column_stack([pressure_heights(air, limit), thrust])
    expected = np.array([*[0.5] * len(DIRECTIONS), WASH_M_PER_G])
    target = altitude - motion.at(time, motion.height[:, None])[:, 0]
    fit = fit_walking(WalkingRows(time_s, target, design, np.ones((time.size, 1)), expected, _KNOTS_S))
    if fit is None:
        return refused(name, f"too short a time in the air away from the ground; {_WHAT_TO_FLY}", **figures)
    figures |= {"noise_m": fit.noise, "walk_m_sqrt_s": fit.walk, "wash_m_per_g": float(fit.constants[-1])}
    figures["wash_error_m_per_g"] = float(fit.standard_error[-1])
    names = [f"EKF2_PCOEF_{one}" for one in DIRECTIONS]
    known = [index for index in range(len(names)) if fit.standard_error[index] <= LARGEST_ERROR]
    estimates = tuple(estimate_of(fit, one, names[one], "", observed.parameters.get(names[one])) for one in known)
    missing = ", ".join(names[one] for one in range(len(names)) if one not in known)
    refusal = f"{missing} not told: too little air from there; {_WHAT_TO_FLY}" if missing else ""
    return Effect(name, estimates, refusal, figures)


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
