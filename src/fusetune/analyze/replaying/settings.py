"""How all sets of a flight are replayed: from which start, and with which gaps made in the sensors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fusetune.analyze.reconstruction.settings import ReconstructionSettings
from fusetune.settings.declaration import setting


@dataclass(frozen=True)
class StartSettings:
    """What the replayed filter starts from.

    Section `start` of the configuration.
    """

    mode: Literal["auto", "warm", "cold"] = setting(
        "auto", "`warm`: the filter starts from the vehicle's own logged state; `cold`: from nothing; `auto` chooses"
    )
    cold_needs_s: float = setting(
        25.0, "time on the ground before take-off from which on `auto` starts cold", unit="s", low=0, high=300
    )
    warm_within_s: float = setting(
        15.0, "`auto` takes no state later than this after the log began", unit="s", low=0, high=300
    )


@dataclass(frozen=True)
class WithholdingSettings:
    """How long each sensor is withheld from the filter, and how often; a length of 0 leaves it alone.

    Section `withheld` of the configuration.
    """

    gnss_s: float = setting(9.0, "length of the gaps without GNSS; 0: none", unit="s", low=0, high=60)
    gnss_every_s: float = setting(
        4.5, "time from the start of one gap without GNSS to the next; gaps may overlap", unit="s", low=0.5, high=600
    )
    gnss_fewest: int = setting(
        4,
        "a flight too short for so many gaps without GNSS has shorter ones, two thirds or a third as long",
        low=0,
        high=100,
    )
    baro_s: float = setting(9.0, "length of the gaps without barometer", unit="s", low=0, high=60)
    baro_every_s: float = setting(
        18.0, "time from the start of one gap without barometer to the next", unit="s", low=0.5, high=600
    )
    mag_s: float = setting(9.0, "length of the gaps without magnetometer", unit="s", low=0, high=60)
    mag_every_s: float = setting(
        18.0, "time from the start of one gap without magnetometer to the next", unit="s", low=0.5, high=600
    )

    def length_s(self, sensor: str) -> float:
        """Length of a sensor's gaps, s."""
        return float(getattr(self, f"{sensor}_s"))

    def every_s(self, sensor: str) -> float:
        """Time between the starts of two gaps of a sensor, s."""
        return float(getattr(self, f"{sensor}_every_s"))


@dataclass(frozen=True)
class ReplaySettings:
    """What is done about a flight before it is replayed; by default nothing.

    Attributes
    ----------
    withholding : gaps that are made in the sensors; None: no gaps
    reconstruction : what is done about a thinned log; None: the samples are used as they were logged
    start : how the filter starts; None: from nothing
    release : whose estimator replays the flight; "auto": that of the release that flew, or the nearest modelled one
    """

    withholding: WithholdingSettings | None = None
    reconstruction: ReconstructionSettings | None = None
    start: StartSettings | None = None
    release: str = "v1.16"


IN_USE = ReplaySettings(WithholdingSettings(), ReconstructionSettings(), StartSettings(), "auto")
"""The default configuration."""

WITHOUT_GAPS = ReplaySettings(None, ReconstructionSettings(), StartSettings(), "auto")
"""The log is repaired and started as the pipeline does it; what a filter predicts without a sensor is not asked."""
