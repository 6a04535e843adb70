"""What García, Molina and Trincado show in figures 5 to 20 of their evaluation, as figures that can be asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

PAPER_FIGURES: Mapping[int, Sequence[str]] = {
    5: ("sensor_gyro",),
    6: ("sensor_accel",),
    7: ("sensor_mag",),
    8: ("sensor_baro",),
    9: ("sensor_gnss_pos", "sensor_gnss_vel"),
    10: ("track",),
    11: ("position",),
    12: ("velocity",),
    13: ("attitude",),
    14: ("innovations_gnss_pos", "innovations_gnss_hgt", "innovations"),
    15: ("innovations_gnss_vel", "innovations"),
    16: ("innovations_mag", "innovations"),
    17: ("normalised_innovations",),
    18: ("rms", "consistency"),
    19: ("test_ratios",),
    20: ("breaks", "test_ratios"),
}
"""Number → names of figures, of a flight or of all flights, whichever there are.

5 to 9 characterise the sensors (sequence, boxes, histogram); what follows is in the order of the evaluation: inputs of
the receiver against outputs of the filter, orientation, innovations over time and as boxes, fusion breaks.
"""
