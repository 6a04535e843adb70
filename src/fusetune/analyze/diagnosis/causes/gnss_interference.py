"""GNSS is jammed: the receiver's own noise rises, satellites fall, the fix flickers."""

from __future__ import annotations

from fusetune.analyze.diagnosis.causes.claim import confidence, diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.gnss_signs import JAMMED_FROM, NOISY_FROM
from fusetune.analyze.diagnosis.signs import Signs

LOST_SATELLITES = 0.75
WORSE_BY = 1.8
REMEDY = (
    "Find the transmitter: video, telemetry or companion computer (USB 3) on board, else one on the ground. "
    "Shield it or the "
    "receiver, move the antenna up and away, choose other frequencies; fly elsewhere if it is not yours"
)


def diagnose(signs: Signs) -> Diagnosis | None:
    """By the receiver's jamming indicator or noise, together with what it costs."""
    gnss = signs.gnss
    if gnss is None or gnss.jammed is None:
        return None
    found = []
    if gnss.jamming > JAMMED_FROM:
        found.append(
            Sign(
                f"the jamming indicator rises from {gnss.usual_jamming:.0f} to {gnss.jamming:.0f}",
                gnss.jamming,
                JAMMED_FROM,
                "",
            )
        )
    if gnss.noise > NOISY_FROM:
        found.append(
            Sign(
                f"the receiver's noise rises from {gnss.usual_noise:.0f} to {gnss.noise:.0f}",
                gnss.noise,
                NOISY_FROM,
                "",
            )
        )
    if gnss.warned:
        found.append(Sign("the receiver itself says that it is jammed", 2.0, 1.0, ""))
    costs = []
    if gnss.satellites < LOST_SATELLITES * gnss.usual_satellites:
        costs.append(
            Sign(
                f"satellites fall from {gnss.usual_satellites:.0f} to {gnss.satellites:.0f}",
                gnss.satellites,
                gnss.usual_satellites,
                "",
            )
        )
    worst, usual = gnss.worst.get("s_variance_m_s", 0.0), gnss.usual.get("s_variance_m_s", 0.0)
    if worst > WORSE_BY * usual:
        costs.append(Sign(f"speed accuracy falls from {usual:.2f} to {worst:.2f} m/s", worst, usual, "m/s"))
    lost = [one for one in gnss.lost if one[1] > gnss.jammed[0] and one[0] < gnss.jammed[1]]
    if lost or not gnss.ever_fixed:
        costs.append(Sign(f"the fix is lost {max(len(lost), 1)} times meanwhile", float(max(len(lost), 1)), 0.0, ""))
    if not found or not costs:
        return None
    return diagnosed(
        signs,
        "gnss_interference",
        "Something jams GNSS",
        "fail" if lost or not gnss.ever_fixed else "warning",
        max(confidence(one.figure, one.usual) for one in found),
        [*found, *costs],
        touches=("gnss",),
        remedy=REMEDY,
        when=gnss.jammed,
        values={"jamming_indicator": gnss.jamming, "noise_per_ms": gnss.noise},
    )
