"""Limits of the trust grades: the section `trust` of the configuration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.analyze.settings import setting, settings_from_mapping
from fusetune.errors import UserError
from fusetune.files import AnyPath


@dataclass(frozen=True)
class TrustSettings:
    """Limits of the figures that the grade follows from, argued in docs/any_log.md.

    Each is the largest value (of `flags_equal` the smallest) for the grades A, B and C; beyond is D.
    """

    innovation_factor: tuple[float, ...] = setting(
        (1.2, 1.6, 3.0), None, None, "", "size of innovations, replay to vehicle"
    )
    velocity_m_s: tuple[float, ...] = setting((0.05, 0.15, 0.4), None, None, "m/s", "difference of horizontal velocity")
    heading_deg: tuple[float, ...] = setting((1.5, 4.0, 10.0), None, None, "deg", "difference of heading")
    flags_equal: tuple[float, ...] = setting((0.98, 0.9, 0.7), None, None, "", "share of time in which the flags agree")
    settle_s: float = setting(1.0, 0.0, 60.0, "s", "time after a warm start that is not compared; cold: 10 s more")
    causes: bool = setting(True, None, None, "", "measure what each cause costs, by a replay each")

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any] | None, file: AnyPath = "config/config.yaml") -> TrustSettings:
        """Read the section `trust`; a missing section or key means the default."""
        given = {name: tuple(map(float, v)) if isinstance(v, list) else v for name, v in (values or {}).items()}
        settings = settings_from_mapping(cls, given, "trust", file)
        for name in FIGURES:
            limits = getattr(settings, name)
            falling = name == "flags_equal"
            if len(limits) != 3 or list(limits) != sorted(limits, reverse=falling):
                order = "falling" if falling else "rising"
                raise UserError(
                    file, f"trust.{name} is {list(limits)}", f"Expected three {order} numbers for A, B and C"
                )
        return settings


FIGURES = ("innovation_factor", "velocity_m_s", "heading_deg", "flags_equal")
