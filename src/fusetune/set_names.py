"""Names of sets that no study may give: the product adds sets of its own, and files beside those of the sets."""

from __future__ import annotations

PRESENT = "present"
AS_FLOWN = "as_flown"
ONBOARD = "onboard"
"""What the vehicle flies now, each log's own parameters (`fusetune.save.present`), and the vehicle's own estimator."""

DELAY_MENDED = "delay_mended"
"""What the vehicle flies now, with those delays of sensors mended that are proved wrong; behind a set's name, that set
with them mended."""

FOUND = "found"
"""What a search found; on a flight, what it found without that flight."""

ANTENNA_MENDED = "antenna_mended"

EFFECT_SETS = {
    ANTENNA_MENDED: "gnss_antenna",
    "static_pressure_mended": "static_pressure",
    "ground_effect_mended": "ground_effect",
    "drag_mended": "drag",
    "declination_mended": "declination",
    "range_arm_mended": "range_lever_arm",
    "range_noise_mended": "range_noise",
    "flow_arm_mended": "optical_flow",
    "vision_arm_mended": "vision_lever_arm",
}
"""Set → the effect whose values it takes: what the vehicle flies now with these as the flights measure them."""

RESERVED_SET_NAMES = (
    *(PRESENT, AS_FLOWN, ONBOARD, DELAY_MENDED, FOUND, *EFFECT_SETS),
    *("sets", "scoring", "fidelity", "delays", "health", "effects", "diagnosis", "sensor_noise", "conformance"),
)
"""With the names of `sets.parquet`, `scoring.json` and the like, which a set so called would overwrite."""


def mended_name(name: str) -> str:
    """Name of a set with the delays mended; no study can give one with a plus sign."""
    return DELAY_MENDED if name == PRESENT else f"{name}+{DELAY_MENDED}"


def is_mended(name: str) -> bool:
    """Whether a set is one with the delays mended."""
    return name == DELAY_MENDED or name.endswith(f"+{DELAY_MENDED}")
