"""Pairs of parameters that trade off: each alone costs something, moved together they hardly do.

With the curvatures a and d of two factors and their coupling b, a step of the first costs ½ a; the second can undo the
share r² = b²/(a d) of that by moving -b/d steps for each of the first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations

import numpy as np
import numpy.typing as npt

from fusetune.apply.sensitivity.kernels import MAIN_EFFECTS
from fusetune.apply.sensitivity.region import Region
from fusetune.apply.sensitivity.result import TradeOff
from fusetune.apply.sensitivity.surface import Surface
from fusetune.apply.statistics.moderated import moderated
from fusetune.apply.trials import Trials

Array = npt.NDArray[np.float64]

UNDONE_SHARE = 0.5
"""A pair trades off if one can undo at least this share of what the other costs."""


def trade_offs(
    trials: Trials, surface: Surface, region: Region, told: npt.NDArray[np.bool_], smallest: float, confidence: float
) -> tuple[TradeOff, ...]:
    """Pairs that trade off around the incumbent, the strongest first.

    Parameters
    ----------
    told : (P,) whether a factor's effect is told
    smallest : nat; a factor that costs less than this at the edge of its neighbourhood has nothing to trade
    """
    if surface.kernel.name == MAIN_EFFECTS or surface.weights.shape[1] < 2:
        return ()
    step = 0.5 * (region.near_high - region.near_low)
    middle = np.clip(region.centre, region.near_low + 0.5 * step, region.near_high - 0.5 * step)
    able = [index for index in np.flatnonzero(told).tolist() if step[index] > 0.0]
    curvature = {index: _curvature(surface, middle, step, index) for index in able}
    curved = [index for index in able if 0.5 * curvature[index].mean() > smallest]
    found = _ridges(trials, surface, middle, step, curved, curvature, confidence)
    return tuple(sorted(found, key=lambda one: -one.undone))


def _ridges(
    trials: Trials,
    surface: Surface,
    middle: Array,
    step: Array,
    curved: list[int],
    curvature: dict[int, Array],
    confidence: float,
) -> Iterator[TradeOff]:
    pairs = list(combinations(curved, 2))
    if not pairs:
        return
    couplings = np.array([_coupling(surface, middle, step, *pair) for pair in pairs])
    for (one, other), coupling, sure in zip(pairs, couplings, moderated(couplings.T), strict=True):
        interval = sure.interval(confidence)
        if interval is None or interval[0] <= 0.0 <= interval[1]:
            continue
        a, d, b = float(curvature[one].mean()), float(curvature[other].mean()), float(coupling.mean())
        undone = b * b / (a * d)
        if undone < UNDONE_SHARE:
            continue
        slope = -b / d * step[other] / step[one]
        factors = trials.factors[one], trials.factors[other]
        steps = [math.log(factor.unit_step) if factor.scale == "log" else 0.0 for factor in factors]
        exponent = slope * steps[1] / steps[0] if all(steps) else None
        yield TradeOff(factors[0].parameter, factors[1].parameter, min(undone, 1.0), exponent, slope)


def _curvature(surface: Surface, middle: Array, step: Array, index: int) -> Array:
    """(F,) second difference over half a step to either side, per step squared."""
    half = np.zeros_like(middle)
    half[index] = 0.5 * step[index]
    below, here, above = surface.at(np.stack([middle - half, middle, middle + half]))
    return np.asarray(4.0 * (below + above - 2.0 * here))


def _coupling(surface: Surface, middle: Array, step: Array, one: int, other: int) -> Array:
    """(F,) mixed second difference, per step of each."""
    first, second = np.zeros_like(middle), np.zeros_like(middle)
    first[one], second[other] = 0.5 * step[one], 0.5 * step[other]
    corners = np.stack(
        [middle + first + second, middle + first - second, middle - first + second, middle - first - second]
    )
    values = surface.at(corners)
    return np.asarray(values[0] - values[1] - values[2] + values[3])
