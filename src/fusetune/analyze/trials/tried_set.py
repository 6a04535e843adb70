"""What a set that was tried did on a flight: sums of its errors, and what else may speak against it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

ONE_STEP, WITHHELD, SMOOTHED = "one_step", "withheld", "smoothed"
"""Kinds of errors: innovations, predictions while a sensor is withheld, velocity less the smoothed one."""


class Column(NamedTuple):
    """One kind of error of one source and axis; `horizon_s` is 0 but where a sensor is withheld."""

    kind: str
    source: str
    axis: int
    horizon_s: float = 0.0


class Sums(NamedTuple):
    """Of n errors ν with variances S: their number, Σν²/S of clipped errors, and Σ ln S.

    Of errors that no set knows the variance of, S is 1.
    """

    n: float
    nis: float
    log_variance: float


class Rejections(NamedTuple):
    """Samples of a source and axis beyond its gate, of how many."""

    rejected: int
    samples: int


@dataclass(frozen=True)
class TriedSet:
    """One set on one flight.

    Attributes
    ----------
    reason : why there are no errors; empty where there are
    sums : by column; those of which the set lacks too much are not there
    flight_s : time in which events are counted, s
    significant_resets, timeouts : resets that moved the state far, and how often a source in use was lost
    fault_s : time with each fault flag that was set, s
    rejections : by source and axis
    """

    reason: str = ""
    sums: Mapping[Column, Sums] = field(default_factory=dict)
    flight_s: float = 0.0
    significant_resets: int = 0
    timeouts: int = 0
    fault_s: Mapping[str, float] = field(default_factory=dict)
    rejections: Mapping[tuple[str, int], Rejections] = field(default_factory=dict)
