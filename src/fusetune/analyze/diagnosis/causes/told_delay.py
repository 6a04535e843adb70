"""What the causes share that a sensor lags by another time than PX4 is told."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

MATTERS_MS, SIGMAS = 20.0, 3.0
"""EKF2 acts on delays in steps of 10 ms."""
STEP_MS = 10.0


def told_wrong(
    signs: Signs,
    id: str,
    label: str,
    parameter: str,
    lag_s: tuple[float, float],
    source: str,
    *,
    earliest_ms: float,
    first: str = "",
) -> Diagnosis | None:
    """The diagnosis where a lag is far from what the parameter says; None where it is not.

    Parameters
    ----------
    label : of the sensor, at the beginning of a sentence
    lag_s : by how much the sensor is late, and the standard error
    source : how the names of its aid sources begin
    earliest_ms : a lag below is none, the fit has found something else
    first : what to do before the parameter is set
    """
    told, value, error = signs.parameters[parameter], 1e3 * lag_s[0], 1e3 * lag_s[1]
    off, level = abs(value - told), MATTERS_MS + SIGMAS * error
    if off < level or value < earliest_ms:
        return None
    mended = max(0.0, STEP_MS * round(value / STEP_MS))
    mend = f"set {parameter} to {mended:.0f} ms"
    words = f"{label} lags behind the motion by {value:.0f} ms (±{2.0 * error:.0f}), PX4 is told {told:.0f}"
    return diagnosed(
        signs,
        id,
        f"{label} is {value:.0f} ms late, and PX4 is told {told:.0f}",
        "warning",
        confidence(off, level, 0.95),
        [Sign(words, off, level, "ms", "replay")],
        touches=(source,),
        remedy=first + mend if first else mend[0].upper() + mend[1:],
        values={parameter: mended},
    )
