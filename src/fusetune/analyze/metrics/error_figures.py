"""Figures of an error whose truth is known: RMSE and its relatives, along and across the track, NEES with bounds."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.analyze.metrics.attitude import down_in_body, heading, wrap
from fusetune.analyze.metrics.consistency import effective_bounds, paper_bounds
from fusetune.analyze.metrics.metric import SOURCE_UNIT, Metric, mean_of_samples
from fusetune.analyze.metrics.whiteness import autocorrelation, effective_samples, lag_limit

Array = npt.NDArray[np.float64]

_SLOWEST_TRACK_M_S = 0.5
"""Below this ground speed there is no direction to split an error along."""

_NEES_STEP_US = 200_000
"""Errors are thinned to this before their correlation is told: at the rate of the filter it would outlast all lags."""


@dataclass(frozen=True)
class ErrorFigure:
    """One figure of the true error: quantity, axis, metric and value over n samples."""

    quantity: str
    axis: str
    metric: str
    value: float
    n: float
    lower: float = np.nan
    upper: float = np.nan


def _harmonic(error: Array) -> float:
    return float(1.0 / mean_of_samples(1.0 / np.maximum(np.abs(error), 1e-12)))


def _geometric(error: Array) -> float:
    return float(np.exp(mean_of_samples(np.log(np.maximum(np.abs(error), 1e-12)))))


_RMSE: Metric[Array] = Metric(
    "rmse", SOURCE_UNIT, "root mean square error", lambda error: np.sqrt(mean_of_samples(np.square(error))),
    "lower",
    ("apply", "report"),
)  # fmt: skip
_MEAN: Metric[Array] = Metric("mean_error", SOURCE_UNIT, "mean error of an axis", mean_of_samples, "nearer to 0")
_MAXIMUM: Metric[Array] = Metric(
    "maximum_error", SOURCE_UNIT, "largest error", lambda error: np.max(np.abs(error)), "lower"
)

NORM_METRICS: tuple[Metric[Array], ...] = (
    _RMSE,
    Metric("average_euclidean_error", SOURCE_UNIT, "mean of the norm", mean_of_samples, "lower"),
    Metric("harmonic_error", SOURCE_UNIT, "harmonic mean of the norm", _harmonic, "lower"),
    Metric("geometric_error", SOURCE_UNIT, "geometric mean of the norm", _geometric, "lower"),
    _MAXIMUM,
)
"""Of the norms (N,) of errors of several axes.

References
----------
García, Molina, Trincado, table 1; Li and Zhao, "Practical measures for performance evaluation", 2001.
"""

COMPONENT_METRICS = (_RMSE, _MEAN, _MAXIMUM)
"""Of one component (N,) of errors."""


def _figures(metrics: Iterable[Metric[Array]], quantity: str, axis: str, error: Array) -> list[ErrorFigure]:
    return [ErrorFigure(quantity, axis, one.name, float(one.function(error)), error.size) for one in metrics]


def norm_figures(quantity: str, axis: str, norm: Array) -> list[ErrorFigure]:
    """The `NORM_METRICS` of error norms (N,)."""
    return _figures(NORM_METRICS, quantity, axis, norm)


@dataclass(frozen=True)
class Track:
    """Where a vehicle truly goes: at which of N times it moves, and M of these directions, north and east."""

    moving: npt.NDArray[np.bool_]
    direction: Array


def track_of(true_velocity: Array) -> Track:
    """The track of a NED velocity (N, 3), m/s."""
    speed = np.hypot(true_velocity[:, 0], true_velocity[:, 1])
    moving = speed > _SLOWEST_TRACK_M_S
    return Track(moving, true_velocity[moving, :2] / speed[moving, None])


def vector_figures(quantity: str, error: Array, track: Track) -> list[ErrorFigure]:
    """Figures of a NED error (N, 3): per axis, horizontal, 3-D, along and across the true track.

    Each axis has its RMSE, mean and maximum; horizontal and 3-D norms have those of `norm_figures`.
    """
    components = {"x": error[:, 0], "y": error[:, 1], "z": error[:, 2]}
    if track.direction.size:
        moving, direction = error[track.moving], track.direction
        components["along_track"] = moving[:, 0] * direction[:, 0] + moving[:, 1] * direction[:, 1]
        components["cross_track"] = moving[:, 1] * direction[:, 0] - moving[:, 0] * direction[:, 1]
    figures = []
    for axis, values in components.items():
        figures += component_figures(quantity, axis, values)
    figures += norm_figures(quantity, "horizontal", np.hypot(error[:, 0], error[:, 1]))
    return figures + norm_figures(quantity, "all", np.linalg.norm(error, axis=1))


def component_figures(quantity: str, axis: str, error: Array) -> list[ErrorFigure]:
    """The `COMPONENT_METRICS` of one component (N,)."""
    return _figures(COMPONENT_METRICS, quantity, axis, error)


class TrueAttitude(NamedTuple):
    """Unit quaternions (N, 4), (w, x, y, z) body → NED; their headings (N,), and the down axis in the body (N, 3)."""

    quaternion: Array
    heading: Array
    down: Array


def true_attitude(quaternion: Array) -> TrueAttitude:
    """What attitudes are compared with."""
    return TrueAttitude(quaternion, heading(quaternion), down_in_body(quaternion))


def attitude_figures(quaternion: Array, true: TrueAttitude) -> list[ErrorFigure]:
    """Figures of heading, tilt and total rotation, deg, of unit quaternions (N, 4), (w, x, y, z) body → NED."""
    off = np.degrees(wrap(heading(quaternion) - true.heading))
    dot = np.clip(np.abs(np.sum(quaternion * true.quaternion, axis=1)), 0.0, 1.0)
    down = np.sum(down_in_body(quaternion) * true.down, axis=1)
    tilt = np.degrees(np.arccos(np.clip(down, -1.0, 1.0)))
    figures = component_figures("attitude_deg", "heading", off) + component_figures("attitude_deg", "tilt", tilt)
    return figures + norm_figures("attitude_deg", "all", np.degrees(2.0 * np.arccos(dot)))


def nees_figures(
    quantity: str,
    axis: str,
    time: npt.NDArray[np.int64],
    error: Array,
    variance: Array,
    confidence: float,
    fitted: int = 0,
) -> list[ErrorFigure]:
    """Normalised estimation error squared ε = Σ e²/P, its mean with χ² bounds; (N, D) arrays.

    `nees` has the paper's bounds for independent samples, `nees_effective` those for N_eff. Only variances are known,
    so this is the diagonal form.

    Parameters
    ----------
    fitted : number of constants that were fitted to the errors beforehand (an unknown origin); the errors lose as
        many degrees of freedom
    """
    if error.shape[0] < 2 or not np.all(variance > 0.0):
        return []
    count, dimension = error.shape
    normalised = error / np.sqrt(variance)
    nees = np.atleast_1d(np.mean(np.sum(np.square(normalised), axis=1)) * count / (count - fitted / dimension))
    step = max(1, round(_NEES_STEP_US / max(float(np.median(np.diff(time))), 1.0)))
    thinned = normalised[::step].T
    n = thinned.shape[1]
    shares = effective_samples(autocorrelation(thinned, lag_limit(n)), n) / n
    independent = np.atleast_1d(n * np.mean(shares))
    plain = paper_bounds(nees, count, dimension, confidence)
    wide = effective_bounds(nees, independent, dimension, confidence)
    return [
        ErrorFigure(quantity, axis, NEES.name, float(nees[0]), count, float(plain.lower[0]), float(plain.upper[0])),
        ErrorFigure(
            quantity,
            axis,
            NEES_EFFECTIVE.name,
            float(nees[0]),
            float(independent[0]),
            float(wide.lower[0]),
            float(wide.upper[0]),
        ),
    ]


NEES: Metric[list[ErrorFigure]] = Metric(
    "nees", "1", "mean of Σ e²/P with χ² bounds for N samples", lambda figures: figures[0].value, "", ("report",)
)
NEES_EFFECTIVE: Metric[list[ErrorFigure]] = Metric(
    "nees_effective", "1", "the same with bounds for N_eff samples", lambda figures: figures[1].value
)
"""Of what `nees_figures` gives; their expectation is the number of axes."""
