"""GNSS jumps while its reported accuracy stays good: multipath, a glitch, spoofing."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.gnss_signs import LEAST_JUMP_M, LEAST_JUMP_M_S
from fusetune.analyze.diagnosis.signs import Signs

FAILS_FROM_M = 25.0
REMEDY = (
    "Keep away from walls and masts that reflect; a better antenna and a receiver with more bands help. Leave "
    "the gates "
    "(EKF2_GPS_P_GATE, EKF2_GPS_V_GATE) as they are, they refuse such jumps. Jumps in open sky: think of spoofing"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By steps that no vehicle makes."""
    gnss = signs.gnss
    if gnss is None or not gnss.jumps:
        return None
    places = [one for one in gnss.jumps if not one.of_velocity]
    speeds = [one for one in gnss.jumps if one.of_velocity]
    found = []
    if places:
        largest = max(places, key=lambda one: one.size)
        words = f"the position jumps {len(places)} times against its own velocity, by {largest.size:.1f} m at most"
        found.append(Sign(words, largest.size, LEAST_JUMP_M, "m"))
    if speeds:
        largest = max(speeds, key=lambda one: one.size)
        words = f"the velocity jumps {len(speeds)} times, by {largest.size:.1f} m/s at most"
        found.append(Sign(words, largest.size, LEAST_JUMP_M_S, "m/s"))
    largest_m = max((one.size for one in places), default=0.0)
    return diagnosed(
        signs,
        "gnss_glitch",
        "GNSS jumps while it reports good accuracy",
        "fail" if largest_m > FAILS_FROM_M else "warning",
        max(confidence(one.figure, one.usual) for one in found),
        found,
        touches=("gnss",),
        remedy=REMEDY,
        when=(gnss.jumps[0].time, gnss.jumps[-1].time + 1_000_000),
        values={"largest_jump_m": round(largest_m, 2)},
    )
