"""How often a diagnosis is right that its signs make so sure of.

What a rule and its experiment say orders diagnoses, but is no share of hits. The share was counted on simulated flights
with known faults, for each kind as many, one in five without any (`benchmarks/diagnosis_study`); docs/diagnosis.md
shows what it is on flights that had no say in it.
"""

from __future__ import annotations

import numpy as np

SAID = (0.0, 0.4, 0.5, 0.6, 0.75, 0.9, 1.0)
RIGHT = (0.0, 0.6, 0.85, 0.9, 0.95, 0.965, 0.985)
"""What signs and experiments say, and the share that is right; between them linearly. Counted on 204 diagnoses of 307
flights: 17 of 19 from 0.45 to 0.65, 36 of 38 to 0.85, 56 of 58 to 0.95, 88 of 89 above."""


def calibrated(said: float) -> float:
    """Share of the diagnoses so sure that are right, 0 to 1."""
    return round(float(np.interp(said, SAID, RIGHT)), 3)
