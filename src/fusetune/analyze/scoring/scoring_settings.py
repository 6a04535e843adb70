"""How a flight is scored: the window, the cuts and the blocks; read from the section `scoring` of the configuration."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.settings import setting, settings_from_mapping
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class ScoringSettings:
    """What is scored of a flight. The same rules hold for all parameter sets of the flight."""

    settle_s: float = setting(5.0, 0.0, 60.0, "s", "time after aiding starts that is not scored")
    warm_settle_s: float = setting(1.0, 0.0, 60.0, "s", "the same after a warm start")
    reset_cut_s: float = setting(3.0, 0.0, 30.0, "s", "time after a reset or a gap in the log that is not scored")
    log_gap_s: float = setting(0.25, 0.05, 5.0, "s", "an IMU gap longer than this is cut like a reset")
    block_s: float = setting(10.0, 2.0, 60.0, "s", "length of the blocks that the bootstrap draws")
    window_s: float = setting(30.0, 5.0, 300.0, "s", "length of the windows of which the worst is reported")
    minimum_scored_s: float = setting(5.0, 1.0, 600.0, "s", "a flight with less than this is not scored")
    max_start_delay_s: float = setting(10.0, 0.0, 120.0, "s", "a set that starts aiding this much later is excluded")
    confidence: float = setting(0.95, 0.5, 0.999, "", "level of all intervals and bounds")

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any] | None, file: AnyPath = "config/config.yaml") -> "ScoringSettings":
        """Read the section `scoring`; a missing section or key means the default."""
        return settings_from_mapping(cls, values, "scoring", file)
