"""What may be reconstructed: the section `reconstruction` of the configuration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.settings import setting, settings_from_mapping
from fusetune.storage.files import AnyPath

RAW = {"imu": False, "magnetometer": False, "barometer": False}
"""Every step switched off."""


@dataclass(frozen=True)
class ReconstructionSettings:
    """Which sensors are reconstructed, from which thinning on, and up to which gap."""

    imu: bool = setting(True, None, None, "", "fill gaps in the IMU rows")
    imu_max_gap_s: float = setting(0.2, 0.0, 1.0, "s", "a longer gap in the IMU rows is left as it is")
    imu_max_missing: float = setting(0.3, 0.0, 0.9, "", "with a larger share missing the IMU is left as it is")
    imu_by_attitude: bool = setting(True, None, None, "", "let the logged attitude tell the rotation over a gap")
    imu_by_velocity: bool = setting(True, None, None, "", "let the logged velocity tell the acceleration over a gap")
    magnetometer: bool = setting(True, None, None, "", "interpolate the magnetometer in the earth frame")
    magnetometer_by_state: bool = setting(True, None, None, "", "let the logged filter states tell the missing noise")
    magnetometer_below_hz: float = setting(10.0, 0.0, 100.0, "Hz", "a log with fewer samples is thinned")
    magnetometer_rate_hz: float = setting(0.0, 0.0, 200.0, "Hz", "rate to interpolate to; 0: the vehicle's own")
    barometer: bool = setting(True, None, None, "", "interpolate the barometer")
    barometer_below_hz: float = setting(8.0, 0.0, 100.0, "Hz", "a log with fewer samples is thinned")
    barometer_rate_hz: float = setting(0.0, 0.0, 100.0, "Hz", "rate to interpolate to; 0: the vehicle's own")
    max_bridge_s: float = setting(2.0, 0.1, 10.0, "s", "magnetometer and barometer gaps that are longer stay open")

    @classmethod
    def from_mapping(
        cls, values: Mapping[str, Any] | None, file: AnyPath = "config/config.yaml"
    ) -> ReconstructionSettings:
        """Read the section `reconstruction`; a missing section or key means the default."""
        return settings_from_mapping(cls, values, "reconstruction", file)
