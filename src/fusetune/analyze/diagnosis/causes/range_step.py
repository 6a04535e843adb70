"""The range finder steps while the vehicle does not: furniture, edges, fog."""

from __future__ import annotations

from fusetune.analyze.diagnosis.beam_signs import STEP_M
from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

FEWEST = 2
REMEDY = (
    "Over furniture, plants or edges let the range finder find the ground only when low (EKF2_RNG_CTRL 1), not "
    "lead the "
    "height; set EKF2_RNG_NOISE first, then EKF2_RNG_K_GATE, by which the filter checks range against its climb rate"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By jumps of the distance beyond what the vehicle climbs."""
    one = signs.range
    if one is None or len(one.steps) < FEWEST:
        return None
    largest = max(abs(size) for _, size in one.steps)
    usual = max(STEP_M, 4.0 * one.noise)
    words = f"the distance jumps {len(one.steps)} times by up to {largest:.1f} m while the vehicle does not"
    return diagnosed(
        signs,
        "range_step",
        "The range finder sees steps below",
        "warning",
        confidence(largest, usual, 0.93),
        [Sign(words, largest, usual, "m", "replay")],
        touches=("rng", "optical_flow"),
        remedy=REMEDY,
        when=(one.steps[0][0], one.steps[-1][0] + 100_000),
        values={"largest_step_m": round(largest, 2)},
    )
