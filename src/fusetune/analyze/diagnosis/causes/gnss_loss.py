"""No GNSS fix for a while, or never."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

LOST_FROM_S = 1.2
FAILS_FROM_S = 5.0
"""The filter dead-reckons for some seconds; after EKF2_NOAID_TOUT, 5 s, it calls its position invalid."""
REMEDY = (
    "Look at the receiver: `fix_type`, antenna, cable, power, sky. Near other radios see interference. Wait for "
    "a fix that "
    "stays before take-off; where there is none by design, say so with EKF2_GPS_CTRL 0"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the time between two messages with a fix."""
    gnss = signs.gnss
    if gnss is None:
        return None
    if not gnss.ever_fixed:
        found = [Sign(f"none of {gnss.samples} messages in the air has a 3D fix", 1.0, 0.0, "1")]
        aided = any(source.startswith(("ev_", "optical_flow")) for source in signs.ratios)
        return diagnosed(
            signs,
            "gnss_loss",
            "The GNSS receiver never has a fix",
            "warning" if aided or signs.table("vehicle_visual_odometry") is not None else "fail",
            0.97,
            found,
            touches=("gnss",),
            remedy=REMEDY,
            values={"without_fix_s": round((signs.whole[1] - signs.whole[0]) * 1e-6, 1)},
        )
    lost = [one for one in gnss.lost if one[1] - one[0] > LOST_FROM_S * 1e6]
    if not lost:
        return None
    longest = max((stop - start) * 1e-6 for start, stop in lost)
    total = sum((stop - start) * 1e-6 for start, stop in lost)
    words = f"{len(lost)} times without a fix, {longest:.1f} s at the longest, {total:.1f} s in all"
    return diagnosed(
        signs,
        "gnss_loss",
        "GNSS is lost in flight",
        "fail" if longest > FAILS_FROM_S else "warning",
        confidence(longest, LOST_FROM_S),
        [Sign(words, longest, LOST_FROM_S, "s")],
        touches=("gnss",),
        remedy=REMEDY,
        when=(lost[0][0], lost[-1][1]),
        values={"without_fix_s": round(total, 1), "longest_without_fix_s": round(longest, 1)},
    )
