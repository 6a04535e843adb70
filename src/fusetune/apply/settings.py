"""How the decision is made; read from the section `decision` of the configuration."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusetune.analyze.settings import setting, settings_from_mapping
from fusetune.analyze.sources import AID_SOURCES
from fusetune.errors import UserError


@dataclass(frozen=True)
class DecisionSettings:
    """Rules of the decision."""

    source: str = setting("gnss_vel", None, None, "", "aid source whose scale-profiled NLL ranks the sets")
    confidence: float = setting(0.95, 0.5, 0.999, "", "level of the intervals")
    draws: int = setting(4000, 200, 200_000, "", "number of bootstrap draws")
    minimum_flights: int = setting(5, 1, 1000, "", "with fewer scored flights the decision is called exploratory")
    correct_for_candidates: bool = setting(
        True, None, None, "", "a change must also survive Holm's correction for the number of candidates"
    )
    seed: int = setting(0, 0, 2**63 - 1, "", "seed of the bootstrap")

    @classmethod
    def from_mapping(
        cls, values: Mapping[str, Any] | None, seed: int | None = None, file: Path | str = "config/config.yaml"
    ) -> "DecisionSettings":
        """Read the section `decision`; `seed` is the one of the whole configuration, where the section has none."""
        values = dict(values or {})
        if seed is not None:
            values.setdefault("seed", seed)
        settings = settings_from_mapping(cls, values, "decision", file)
        if settings.source not in AID_SOURCES:
            raise UserError(
                file,
                f"decision.source is {settings.source!r}, which is no aid source",
                f"Use one of: {', '.join(sorted(AID_SOURCES))}",
            )
        return settings
