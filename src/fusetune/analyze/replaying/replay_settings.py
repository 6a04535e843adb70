"""How all sets of a flight are replayed: the sections `withheld`, `reconstruction` and `start` of the configuration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.analyze.reconstruction import ReconstructionSettings
from fusetune.analyze.replaying.start_choice import StartSettings
from fusetune.analyze.replaying.withheld_gaps import WithholdingSettings
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class ReplaySettings:
    """What is done about a flight before it is replayed; by default nothing.

    Attributes
    ----------
    withholding : gaps that are made in the sensors; None: no gaps
    reconstruction : what is done about a thinned log; None: the samples are used as they were logged
    start : how the filter starts; None: from nothing
    """

    withholding: WithholdingSettings | None = None
    reconstruction: ReconstructionSettings | None = None
    start: StartSettings | None = None

    @classmethod
    def from_mapping(
        cls, sections: Mapping[str, Mapping[str, Any]], file: AnyPath = "config/config.yaml"
    ) -> ReplaySettings:
        """Read the sections `withheld`, `reconstruction` and `start`; a missing one means its defaults."""
        return cls(
            WithholdingSettings.from_mapping(sections.get("withheld"), file),
            ReconstructionSettings.from_mapping(sections.get("reconstruction"), file),
            StartSettings.from_mapping(sections.get("start"), file),
        )


IN_USE = ReplaySettings(WithholdingSettings(), ReconstructionSettings(), StartSettings())
"""The default configuration."""
