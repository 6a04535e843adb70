"""What the causes share: how sure a figure makes one, and how much of the innovations' excess is explained."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.innovation_signs import excess
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.flight.intervals import Interval

PX4_GUIDE = "PX4 guide, Using PX4's navigation filter (EKF2)"
MOST_SURE = 0.97
"""No rule is right more often than this on flights that it was not made with."""


def confidence(figure: float, usual: float, most: float = MOST_SURE) -> float:
    """How sure a figure makes one that is beyond what is usual: half at the level, `most` from four times it on.

    By this diagnoses are told apart and put in order; how often they are right is `reliability.calibrated`.
    """
    beyond = max(figure / max(usual, 1e-9), 1.0)
    return most - (most - 0.5) * math.exp(-1.5 * (beyond - 1.0))


def diagnosed(
    signs: Signs,
    id: str,
    cause: str,
    severity: Literal["note", "warning", "fail"],
    sure: float,
    found: Sequence[Sign],
    *,
    touches: Sequence[str] = (),
    remedy: str,
    source: str = PX4_GUIDE,
    when: Interval | None = None,
    values: Mapping[str, float] | None = None,
) -> Diagnosis:
    """A diagnosis; what it explains is the excess of the sources that it touches, and how far the first sign is off."""
    start, stop = when or signs.whole
    first = found[0]
    strength = math.log1p(abs(first.figure) / max(abs(first.usual), 1e-9)) if math.isfinite(first.figure) else 0.0
    explained = excess(signs.ratios, *touches) if touches else 0.0
    ordered = dict(values or {})
    return Diagnosis(
        id,
        cause,
        severity,
        round(sure, 3),
        round(explained + strength, 4),
        start,
        stop,
        tuple(found),
        remedy,
        source,
        ordered,
    )
