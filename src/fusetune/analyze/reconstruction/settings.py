"""What of a log may be reconstructed, from which thinning on, and up to which gap."""

from __future__ import annotations

from dataclasses import dataclass

from fusetune.settings.declaration import setting


@dataclass(frozen=True)
class ReconstructionSettings:
    """What of a thinned log is reconstructed before it is replayed.

    Section `reconstruction` of the configuration.
    """

    imu: bool = setting(True, "fill gaps in the IMU rows")
    imu_max_gap_s: float = setting(0.2, "a longer gap in the IMU rows is left as it is", unit="s", low=0, high=1)
    imu_max_missing: float = setting(
        0.3, "with a larger share of the rows missing the IMU is left as it is", low=0, high=0.9
    )
    imu_by_attitude: bool = setting(True, "let the logged attitude tell the rotation over a gap")
    imu_by_velocity: bool = setting(True, "let the logged velocity tell the acceleration over a gap")
    magnetometer: bool = setting(True, "interpolate the magnetometer in the earth frame")
    magnetometer_by_state: bool = setting(True, "let the logged filter states tell the missing noise")
    magnetometer_below_hz: float = setting(
        10.0, "a log with fewer magnetometer samples is thinned", unit="Hz", low=0, high=100
    )
    magnetometer_rate_hz: float = setting(
        0.0,
        "rate to interpolate to; 0 is the vehicle's own (`SENS_MAG_RATE`, else 50)",
        unit="Hz",
        low=0,
        high=200,
    )
    barometer: bool = setting(True, "interpolate the barometer")
    barometer_below_hz: float = setting(
        8.0, "a log with fewer barometer samples is thinned", unit="Hz", low=0, high=100
    )
    barometer_rate_hz: float = setting(
        0.0,
        "rate to interpolate to; 0 is the vehicle's own (`SENS_BARO_RATE`, else 20)",
        unit="Hz",
        low=0,
        high=100,
    )
    max_bridge_s: float = setting(
        2.0, "longer gaps of magnetometer and barometer stay open", unit="s", low=0.1, high=10
    )
