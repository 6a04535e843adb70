"""What a replay leaves: rows that the filter published, how it went, and what it predicted in gaps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES


@dataclass(frozen=True)
class Gap:
    """A time in which the measurements of one sensor are withheld from the filter.

    Attributes
    ----------
    sensor : a key of `fusetune.ekf2.replay.withholding.WITHHOLDABLE`
    start, stop : IMU timestamps (µs)
    """

    sensor: str
    start: int
    stop: int


@dataclass(frozen=True)
class GapResult:
    """What the filter did in a gap.

    Attributes
    ----------
    start : fusion time horizon when the withholding began (µs)
    innovations : rows of the sensor's own aid sources: what it measured, against what was predicted without it
    local_position : (2,) rows at the beginning and at the end
    """

    gap: Gap
    start: int
    innovations: np.ndarray
    local_position: np.ndarray


@dataclass(frozen=True, kw_only=True)
class ReplaySummary:
    """How a replay went, without the rows that it published."""

    mode: str
    imu_samples: int
    updates: int
    update_interval_us: float
    """Median time between two updates; 0 with fewer than two."""
    origin: tuple[float, float, float] | None
    """Latitude and longitude (deg) and altitude (m) of the local frame, None while never set."""
    resets: Mapping[str, int]
    """Reset counters at the end of the flight, under the names of `vehicle_local_position`."""
    filter_fault_flags_max: int
    """Largest value of the fault flags seen as one number, like `estimator_status.filter_fault_flags`."""
    diverged: bool
    """Whether a state or variance stopped being a finite number."""
    gaps: tuple[GapResult, ...] = ()
    warm_start_us: int | None = None
    """Fusion time horizon at which the filter took over the vehicle's state, None where it started from nothing."""
    levelled: bool = False
    """Whether the filter ever had its tilt, without which it does not begin."""


@dataclass(frozen=True, kw_only=True)
class ReplayResult(ReplaySummary):
    """What one replay published, as structured arrays in time order (see `fusetune.ekf2.replay.recording`)."""

    innovations: np.ndarray
    states: np.ndarray
    local_position: np.ndarray
    flags: np.ndarray

    def source_names(self) -> np.ndarray:
        """Aid source of each innovation row."""
        return np.array(AID_SOURCE_NAMES)[self.innovations["source"]]
