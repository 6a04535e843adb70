"""How often a diagnosis is right that its signs make so sure of.

What a rule and its experiment say orders diagnoses, but is no share of hits. The share is a logistic curve over the
odds of what they say (Platt, 1999), its two figures drawn towards none (0 and 1). It was fitted to simulated flights
with known faults, for each kind as many, one in three without any, that had no say when levels were set: on those that
had, unsure ones are right more often than they will be (`benchmarks/diagnosis_study/reliability_fit.py`).
docs/diagnosis.md shows what it is on flights that had no say in the curve.
"""

from __future__ import annotations

import math

OFFSET, SLOPE = 0.62, 2.15
LARGEST = 0.99
"""Nobody is surer of a rule: of 240 diagnoses so sure 239 were right."""
_LEAST = 1e-3


def calibrated(said: float) -> float:
    """Share of the diagnoses so sure that are right, 0 to 1."""
    inside = min(max(said, _LEAST), 1.0 - _LEAST)
    odds = OFFSET + SLOPE * math.log(inside / (1.0 - inside))
    return round(min(1.0 / (1.0 + math.exp(-odds)), LARGEST), 3)


def said_of(share: float) -> float:
    """What signs and experiments said of a diagnosis that is told with this share; of the largest the least that is."""
    odds = math.log(min(max(share, _LEAST), LARGEST) / (1.0 - min(max(share, _LEAST), LARGEST)))
    return 1.0 / (1.0 + math.exp(-(odds - OFFSET) / SLOPE))
