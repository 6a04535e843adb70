"""The score along one parameter: the others as the incumbent has them, or each time at their best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from fusetune.apply.sensitivity.flight_spread import Spread, spread_of
from fusetune.apply.sensitivity.kernels import MAIN_EFFECTS
from fusetune.apply.sensitivity.region import Region
from fusetune.apply.sensitivity.surface import Surface

Array = npt.NDArray[np.float64]

CURVE_POINTS = 41
_BEST_EVERY = 5


@dataclass(frozen=True, eq=False)
class Course:
    """How the score goes along one factor.

    Attributes
    ----------
    coordinates : (G,) from end to end of what was tried, the incumbent's and the ends of the neighbourhood among them
    to_present : (G,) mean differences to the present set, nat
    to_centre : differences to the incumbent
    others_at_best : (G,) mean difference to the present set with all others at their best; None where the surface has
        no interactions, as the best of the others is then the same everywhere
    resolution : share of what could be that the sets tell, mean over the course, 0 … 1
    """

    coordinates: Array
    to_present: Array
    to_centre: Spread
    others_at_best: Array | None
    resolution: float


def course_along(surface: Surface, region: Region, index: int, compared: Array, confidence: float) -> Course:
    """The course along factor `index`."""
    even = np.linspace(region.low[index], region.high[index], CURVE_POINTS)
    marks = (region.near_low[index], region.centre[index], region.near_high[index])
    coordinates = np.unique(np.concatenate([even, marks]))
    places = region.along(index, coordinates)
    centre, values = region.centre, surface.at(places)
    from_centre = values - surface.at(centre[None, :])
    to_centre = spread_of(from_centre, surface.uncertainty(places, centre), compared, confidence)
    apart = np.abs(coordinates - centre[index]) > 1e-9
    resolved = surface.resolution(places[apart], centre)
    best = None
    if surface.kernel.name != MAIN_EFFECTS and len(centre) > 1:
        best = _others_at_best(surface, region, index, coordinates)
    return Course(coordinates, values.mean(axis=1), to_centre, best, float(resolved.mean()) if resolved.size else 0.0)


def _others_at_best(surface: Surface, region: Region, index: int, coordinates: Array) -> Array:
    """Lowest mean difference over the other factors at each place, sought at some and joined by straight lines."""
    rows = np.unique([*range(0, len(coordinates), _BEST_EVERY), len(coordinates) - 1])
    others = np.arange(len(region.centre)) != index
    found: dict[int, float] = {}
    nearest = sorted(rows.tolist(), key=lambda row: abs(coordinates[row] - region.centre[index]))
    starts = {-1.0: region.centre, 1.0: region.centre}
    for row in nearest:
        side = float(np.sign(coordinates[row] - region.centre[index])) or 1.0
        found[row], starts[side] = _lowest(surface, region, others, index, coordinates[row], starts[side])
    return np.interp(coordinates, coordinates[rows], [round(found[row], 4) for row in rows.tolist()])


def _lowest(
    surface: Surface, region: Region, others: npt.NDArray[np.bool_], index: int, coordinate: float, start: Array
) -> tuple[float, Array]:
    """The lowest mean difference with one factor held, and where it is."""
    step = np.maximum(1e-3 * (region.high - region.low)[others], 1e-6)

    def value_and_slope(free: Array) -> tuple[float, Array]:
        places = np.tile(start, (1 + 2 * len(free), 1))
        places[:, index] = coordinate
        places[:, others] = np.vstack([free, free + np.diag(step), free - np.diag(step)])
        values = surface.mean_at(places)
        return float(values[0]), (values[1 : 1 + len(free)] - values[1 + len(free) :]) / (2.0 * step)

    bounds = list(zip(region.near_low[others], region.near_high[others], strict=True))
    answer = minimize(
        value_and_slope, start[others], jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 30}
    )
    place = start.copy()
    place[index], place[others] = coordinate, answer.x
    return float(answer.fun), place
