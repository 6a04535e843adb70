"""A sensor repeats one value."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import STUCK_S, Signs

LABELS = {"mag": "the magnetometer", "baro": "the barometer", "gnss": "GNSS"}
SOURCES = {"mag": ("mag",), "baro": ("baro",), "gnss": ("gnss",)}
REMEDY = (
    "Check the sensor, its wiring and its driver before the next flight; a second sensor of the kind lets PX4 "
    "change over"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the longest time in the air in which all of its digits stayed."""
    stuck = {
        name: one
        for name, one in signs.stuck.items()
        if not (name == "gnss" and signs.gnss is not None and _lost(signs, one.start_us))
    }
    if not stuck:
        return None
    name, longest = max(stuck.items(), key=lambda item: item[1].longest_s)
    found = [
        Sign(f"{LABELS[sensor]} holds one value for {one.longest_s:.1f} s", one.longest_s, STUCK_S, "s")
        for sensor, one in sorted(stuck.items(), key=lambda item: -item[1].longest_s)
    ]
    return diagnosed(
        signs,
        "sensor_stuck",
        f"{LABELS[name][0].upper()}{LABELS[name][1:]} repeats one value",
        "fail",
        confidence(longest.longest_s, 0.6 * STUCK_S),
        found,
        touches=tuple(source for sensor in stuck for source in SOURCES[sensor]),
        remedy=REMEDY,
        when=(longest.start_us, longest.stop_us),
        values={f"{sensor}_stuck_s": round(one.longest_s, 2) for sensor, one in stuck.items()},
    )


def _lost(signs: Signs, time: int) -> bool:
    """A receiver without a fix repeats its last position, and is not stuck."""
    gnss = signs.gnss
    return gnss is not None and (
        not gnss.ever_fixed or any(start - 500_000 <= time <= stop for start, stop in gnss.lost)
    )
