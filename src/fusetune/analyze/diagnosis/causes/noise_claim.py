"""The noise that PX4 is told of a sensor is far from what the sensor does."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.claims import FAR
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs

LABELS = {
    "gnss_vel": "GNSS velocity",
    "gnss_pos": "GNSS position",
    "baro_hgt": "the barometer",
    "mag": "the magnetometer",
}


def diagnose(signs: Signs) -> Diagnosis | None:
    """By readings against the claim, where PX4's default does not claim as much, either."""
    found, values, touched = [], {}, []
    for source, one in signs.claims.items():
        if source == "mag" and signs.parameters.get("EKF2_MAG_TYPE", 0.0) == 5.0:
            continue
        if one.too_small:
            words = f"{LABELS[source]} scatters by {one.measured:.3g}, {one.parameter} claims {one.told:.3g}"
            found.append(Sign(words, one.measured / one.effective, FAR, "1", "replay"))
        elif one.too_large:
            words = f"{one.parameter} claims {one.told:.3g}, {LABELS[source]} scatters by {one.measured:.3g}"
            found.append(Sign(words, one.told / max(one.measured, 0.25 * one.usual), FAR, "1", "replay"))
        else:
            continue
        touched.append(source)
        values[one.parameter] = round(max(one.measured, one.usual if one.told > one.measured else one.measured), 4)
    if not found:
        return None
    found.sort(key=lambda one: -one.figure)
    told = ", ".join(f"{name} {value:g}" for name, value in values.items())
    return diagnosed(
        signs,
        "noise_claim",
        "PX4 is told a noise far from what the sensor does",
        "warning",
        confidence(found[0].figure, 0.8 * FAR, 0.93),
        found,
        touches=touched,
        remedy=f"Begin with {told}, then let several flights choose (docs/search.md)",
        values=values,
    )
