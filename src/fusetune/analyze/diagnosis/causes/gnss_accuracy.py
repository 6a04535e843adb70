"""GNSS is poor, and says so."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.gnss_signs import is_poor
from fusetune.analyze.diagnosis.signs import Signs

LABELS = {
    "eph": ("horizontal accuracy", "m"),
    "epv": ("vertical accuracy", "m"),
    "s_variance_m_s": ("speed accuracy", "m/s"),
}
FAILS_FROM = 4.0
"""Times the limit."""
REMEDY = (
    "Give the antenna a free sky and a ground plane, away from other electronics, and wait before take-off until "
    "accuracy "
    "has settled (typical: 0.8 m, 1.5 m and 0.3 m/s). Do not raise EKF2_REQ_* to fly with less"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the accuracy that the receiver reports, against what PX4 asks for."""
    gnss = signs.gnss
    if gnss is None or gnss.poor is None:
        return None
    found = []
    for name, (label, unit) in LABELS.items():
        worst, limit = gnss.worst.get(name, 0.0), gnss.limit.get(name, float("nan"))
        if is_poor(worst, gnss.usual.get(name, limit), limit):
            words = f"{label} falls to {worst:.2f} {unit}, PX4 asks for {limit:.2f}"
            found.append(Sign(words, worst, limit, unit))
    if not found:
        return None
    found.sort(key=lambda one: one.usual / one.figure)
    factor = found[0].figure / found[0].usual
    return diagnosed(
        signs,
        "gnss_accuracy",
        "GNSS is poor, and the receiver says so",
        "fail" if factor > FAILS_FROM else "warning",
        confidence(factor, 0.8),
        found,
        touches=("gnss",),
        remedy=REMEDY,
        when=gnss.poor,
        values={f"worst_{name}": round(value, 3) for name, value in gnss.worst.items()},
    )
