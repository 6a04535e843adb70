"""Limits of the trust grades: the section `trust` of the configuration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.errors import UserError
from fusetune.settings import setting, settings_from_mapping
from fusetune.storage.files import AnyPath

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

_NEEDED_FOR_B = ("velocity_m_s", "height_m", "vertical_velocity_m_s", "height_resets")


@dataclass(frozen=True)
class TrustSettings:
    """Limits of the figures that the grade follows from, argued in docs/any_log.md.

    Each is the largest value (of those in `FALLING` the smallest) for the grades A, B and C; beyond is D. A flight of
    which a figure in `needed_for_a` could not be compared has a B at best, of one in `needed_for_b` a C.
    """

    innovation_factor: tuple[float, ...] = setting(
        (1.2, 1.6, 3.0), None, None, "", "size of innovations, replay to vehicle"
    )
    velocity_m_s: tuple[float, ...] = setting((0.05, 0.15, 0.4), None, None, "m/s", "difference of horizontal velocity")
    heading_deg: tuple[float, ...] = setting((1.5, 4.0, 10.0), None, None, "deg", "difference of heading")
    height_m: tuple[float, ...] = setting((0.35, 1.0, 3.5), None, None, "m", "difference of height less its mean")
    vertical_velocity_m_s: tuple[float, ...] = setting(
        (0.075, 0.225, 0.6), None, None, "m/s", "difference of vertical velocity"
    )
    height_resets: tuple[float, ...] = setting((0.0, 1.0, 3.0), None, None, "", "resets of height more or fewer")
    flags_equal: tuple[float, ...] = setting((0.98, 0.9, 0.7), None, None, "", "share of time in which the flags agree")
    height_flags_equal: tuple[float, ...] = setting(
        (0.98, 0.9, 0.7), None, None, "", "share of time in which the height comes from the same sources"
    )
    needed_for_a: tuple[str, ...] = setting(FIGURES, None, None, "", "figures without which there is no A")
    needed_for_b: tuple[str, ...] = setting(_NEEDED_FOR_B, None, None, "", "figures without which there is no B")
    settle_s: float = setting(1.0, 0.0, 60.0, "s", "time after a warm start that is not compared; cold: 10 s more")
    causes: bool = setting(True, None, None, "", "measure what each cause costs, by a replay each")

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any] | None, file: AnyPath = "config/config.yaml") -> TrustSettings:
        """Read the section `trust`; a missing section or key means the default."""
        given = {name: _as_tuple(name, value, file) for name, value in (values or {}).items()}
        settings = settings_from_mapping(cls, given, "trust", file)
        for name in FIGURES:
            limits = getattr(settings, name)
            falling = name in FALLING
            if len(limits) != 3 or list(limits) != sorted(limits, reverse=falling):
                order = "falling" if falling else "rising"
                raise UserError(
                    file, f"trust.{name} is {list(limits)}", f"Expected three {order} numbers for A, B and C"
                )
        return settings


def _as_tuple(name: str, value: Any, file: AnyPath) -> Any:
    """A list of the configuration as limits, or as names of figures."""
    if not isinstance(value, list):
        return value
    needed = name in ("needed_for_a", "needed_for_b")
    try:
        entries = tuple(str(one) if needed else float(one) for one in value)
    except (TypeError, ValueError) as error:
        raise UserError(file, f"trust.{name} is {value!r}", "Expected three numbers for A, B and C") from error
    unknown = [one for one in entries if needed and one not in FIGURES]
    if unknown:
        raise UserError(file, f"trust.{name} names {unknown[0]!r}", f"Use some of: {', '.join(FIGURES)}")
    return entries
