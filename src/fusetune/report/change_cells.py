"""Changes on each flight as cells of a heat map: how far their colours reach, and the few signs in them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt


def colour_reach(values: npt.NDArray[np.float64]) -> float:
    """Where the colour is full: a hopeless set takes the end of the scale and leaves the others theirs, percent.

    Parameters
    ----------
    values : (flights, sets), percent; NaN where a flight does not tell
    """
    size = np.abs(values[:, np.isfinite(values).any(axis=0)])
    if not size.size:
        return 1.0
    typical = np.nanmedian(size, axis=0)
    shown = size[:, typical <= 3.0 * max(float(np.median(typical)), 0.3)]
    return max(float(np.nanquantile(shown, 0.9)), 1.0)


def cell_words(value: float) -> str:
    """A change in few signs: "–" where it is not known, "=" where there is none."""
    if math.isnan(value):
        return "–"
    if value == 0.0:
        return "="
    if abs(value) >= 999.5:
        return "≫" if value > 0.0 else "≪"
    return (f"{value:+.0f}" if abs(value) >= 9.5 else f"{value:+.1f}").replace("-", "−")
