"""The decision as the paper makes it, for comparison: lowest aggregate RMS of position and velocity innovations.

García, Molina, Trincado, "Real evaluation for designing sensor fusion in UAV platforms". It ranks one flight per
set, and a set that follows wandering measurements profits, so it stands beside the decision and never makes it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

PAPER_VARIABLES = {
    "pos_x": (("gnss_pos", "x"),),
    "pos_y": (("gnss_pos", "y"),),
    "pos_z": (("gnss_hgt", "x"), ("baro_hgt", "x")),
    "vel_x": (("gnss_vel", "x"),),
    "vel_y": (("gnss_vel", "y"),),
    "vel_z": (("gnss_vel", "z"),),
    "mag_x": (("mag", "x"),),
    "mag_y": (("mag", "y"),),
    "mag_z": (("mag", "z"),),
}
"""Variable of the paper's table 12 → the source and axis that show it, the first that a flight has."""

POSITION_VARIABLES = ("pos_x", "pos_y", "pos_z")
VELOCITY_VARIABLES = ("vel_x", "vel_y", "vel_z")
AGGREGATED_VARIABLES = (*POSITION_VARIABLES, *VELOCITY_VARIABLES)


@dataclass(frozen=True)
class PaperEntry:
    """One set as the paper sees it.

    Attributes
    ----------
    aggregate_rms : position and velocity together
    consistent : mean NIS within its two-sided χ² bounds; None where unknown
    break_rate : of all fused observations
    """

    name: str
    aggregate_rms: float
    consistent: bool | None = None
    break_rate: float = 0.0


def aggregate_rms(rms: Mapping[str, float]) -> float:
    """Root of the summed squares of the position and velocity RMS; NaN where one is missing.

    The paper's own aggregate row follows from its other rows by no rule that it states; where a table brings that
    row, take it as it is.
    """
    return root_sum(rms, AGGREGATED_VARIABLES)


def root_sum(rms: Mapping[str, float], names: Sequence[str]) -> float:
    """Root of the summed squares of some of the variables; NaN where one is missing."""
    return math.sqrt(sum(rms.get(name, math.nan) ** 2 for name in names))


def paper_ranking(entries: Sequence[PaperEntry]) -> list[PaperEntry]:
    """Order sets as the paper does: consistent ones first where any is, then by aggregate RMS, then by break rate."""
    any_consistent = any(entry.consistent for entry in entries)

    def key(entry: PaperEntry) -> tuple[bool, bool, float, float, str]:
        inconsistent = any_consistent and entry.consistent is False
        missing = math.isnan(entry.aggregate_rms)
        return inconsistent, missing, 0.0 if missing else entry.aggregate_rms, entry.break_rate, entry.name

    return sorted(entries, key=key)
