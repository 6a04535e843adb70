"""Limits of the trust grades."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fusetune.settings.declaration import setting

FALLING = ("flags_equal", "height_flags_equal")
"""Figures of which more is better."""

FIGURES = (
    "innovation_factor",
    "velocity_m_s",
    "heading_deg",
    "height_m",
    "vertical_velocity_m_s",
    "height_resets",
    "flags_equal",
    "height_flags_equal",
)
"""What the grade follows from, attributes of `fusetune.analyze.trust.as_flown_figures.AsFlownFigures`."""

Limits = tuple[float, float, float]
"""For the grades A, B and C."""

_NEEDED_FOR_B = ("velocity_m_s", "height_m", "vertical_velocity_m_s", "height_resets")


@dataclass(frozen=True)
class TrustSettings:
    """Limits of the figures for the trust grades A, B and C.

    Section `trust` of the configuration, argued in docs/any_log.md. Each limit is the largest value (of those in
    `FALLING` the smallest) for its grade; beyond the last is D.
    """

    innovation_factor: Limits = setting(
        (1.2, 1.6, 3.0), "grades A, B, C: size of innovations, replay to vehicle", low=1
    )
    velocity_m_s: Limits = setting(
        (0.05, 0.15, 0.4), "grades A, B, C: RMS difference of horizontal velocity", unit="m/s", low=0
    )
    heading_deg: Limits = setting((1.5, 4.0, 10.0), "grades A, B, C: RMS difference of heading", unit="°", low=0)
    height_m: Limits = setting(
        (0.35, 1.0, 3.5), "grades A, B, C: RMS difference of height, less its mean", unit="m", low=0
    )
    vertical_velocity_m_s: Limits = setting(
        (0.075, 0.225, 0.6), "grades A, B, C: RMS difference of vertical velocity", unit="m/s", low=0
    )
    height_resets: Limits = setting(
        (0.0, 1.0, 3.0),
        "grades A, B, C: resets of height, or of vertical velocity, that the replay has more or fewer",
        low=0,
    )
    flags_equal: Limits = setting(
        (0.98, 0.9, 0.7), "grades A, B, C: share of time in which the flags agree", low=0, high=1
    )
    height_flags_equal: Limits = setting(
        (0.98, 0.9, 0.7), "grades A, B, C: share of time in which the height comes from the same sources", high=1, low=0
    )
    needed_for_a: tuple[str, ...] = setting(
        FIGURES, "a flight of which one of these figures could not be compared has a B at best", choices=FIGURES
    )
    needed_for_b: tuple[str, ...] = setting(
        _NEEDED_FOR_B, "a flight of which one of these figures could not be compared has a C at best", choices=FIGURES
    )
    settle_s: float = setting(
        1.0, "time after a warm start that is not compared; 10 s more after a cold one", unit="s", low=0, high=60
    )
    causes: bool = setting(True, "measure what each cause costs, by a replay each")

    def problems(self) -> Iterator[str]:
        """Limits that are not in the order of the grades."""
        for name in FIGURES:
            limits, falls = getattr(self, name), name in FALLING
            if list(limits) != sorted(limits, reverse=falls):
                order = "falling" if falls else "rising"
                yield f"{name} is {list(limits)}; expected three {order} numbers for A, B and C"


def reaches(grade: str | None, lowest: str) -> bool:
    """Whether a trust grade is no lower than another; one of None, of a flight with nothing to compare, is not."""
    return grade is None or grade <= lowest
