"""No GNSS fix for a while, or never."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.gnss_signs import has_fix
from fusetune.analyze.diagnosis.signs import Signs

LOST_FROM_S = 1.2
FAILS_FROM_S = 5.0
"""The filter dead-reckons for some seconds; after EKF2_NOAID_TOUT, 5 s, it calls its position invalid."""
NEVER = "the log has no message of a receiver in the air (`vehicle_gps_position`)"
REMEDY = (
    "Look at the receiver: `fix_type`, antenna, cable, power, sky. Near other radios see interference. Wait for "
    "a fix that "
    "stays before take-off; where there is none by design, say so with EKF2_GPS_CTRL 0"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the time between two messages with a fix."""
    gnss = signs.gnss
    if gnss is None:
        return _silent(signs)
    if not gnss.ever_fixed:
        found = [Sign(f"none of {gnss.samples} messages in the air has a 3D fix with a position", 1.0, 0.0, "1")]
        return diagnosed(
            signs,
            "gnss_loss",
            "The GNSS receiver never has a fix",
            "warning" if _is_aided(signs) else "fail",
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


def _is_aided(signs: Signs) -> bool:
    """Whether something else tells where the vehicle is."""
    aided = any(source.startswith(("ev_", "optical_flow")) for source in signs.ratios)
    return aided or signs.table("vehicle_visual_odometry") is not None


def _silent(signs: Signs) -> Diagnosis | None:
    """Of a receiver without messages in the air: one that fell silent, or one that PX4 waits for and nobody sees."""
    in_air_s = sum(stop - start for start, stop in signs.airborne) * 1e-6
    if in_air_s < FAILS_FROM_S or signs.parameters.get("EKF2_GPS_CTRL", 0.0) == 0.0:
        return None
    table = signs.table("vehicle_gps_position")
    reported = table is not None and "fix_type" in table and bool(has_fix(table).any())
    if not reported and not signs.is_replayed:
        # of a log that is refused, as for records that are lost, it may be these that are missing
        return None
    words = "no message of a receiver in the air, though it had a fix on the ground" if reported else NEVER
    return diagnosed(
        signs,
        "gnss_loss",
        "GNSS is lost in flight" if reported else "PX4 is told to use GNSS, and no receiver reports",
        "note" if not reported else "warning" if _is_aided(signs) else "fail",
        0.97,
        [Sign(words, in_air_s, LOST_FROM_S, "s")],
        touches=("gnss",),
        remedy=REMEDY,
        values={"without_fix_s": round(in_air_s, 1)},
    )
