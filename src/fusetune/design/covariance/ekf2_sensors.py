"""Sensors of a design for EKF2: what each is told by, and the parameters that follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fusetune.px4.aid_sources import AID_SOURCES, SENSORS
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.settings.declaration import required, setting

DESIGNED = ("gnss", "mag", "baro", "range", "flow", "ev", "airspeed")
"""Sensors that a design can have, by their names in `px4/aid_sources.py`."""

PROCESS_NOISES: Mapping[str, tuple[str, ...]] = {
    "gyro": ("EKF2_GYR_NOISE",),
    "accelerometer": ("EKF2_ACC_NOISE",),
    "gyro_bias": ("EKF2_GYR_B_NOISE",),
    "accelerometer_bias": ("EKF2_ACC_B_NOISE",),
}
"""What the IMU is told by, which is always there."""

SENSOR_NOISES: Mapping[str, tuple[str, ...]] = {
    name: tuple(
        dict.fromkeys(
            noise for source in AID_SOURCES.values() if source.sensor == name and source.code is not None
            for noise in source.noises
        )
    )
    for name in DESIGNED
}  # fmt: skip
"""Parameters of the noise of each sensor; the receiver of a design reports nothing better, so floors act."""

SWITCHED_ON = {"EKF2_OF_CTRL": 1, "EKF2_EV_CTRL": 15, "EKF2_ARSP_THR": 0.1, "EKF2_RNG_CTRL": 1, "EKF2_GPS_CTRL": 7,
               "EKF2_BARO_CTRL": 1, "EKF2_MAG_TYPE": 0}  # fmt: skip
"""Value of the switch of a sensor that is used where the parameters leave it switched off."""

NOISE_BY_PARAMETER = {"EKF2_EV_NOISE_MD": 1}
HORIZON_SHARE, HORIZON_MS = 1.25, 10.0
"""How far beyond the longest delay EKF2 is told to look back: it counts in updates of 10 ms, and where the samples of
the IMU make these 8 ms long it looks back less far than it is told, and fuses too late what is later than that."""
LEAST_DELAY_MAX_MS = 20.0
"""Two of EKF2's intervals; its buffers need that."""
DELAY_MAX = "EKF2_DELAY_MAX"


@dataclass(frozen=True)
class Ekf2Sensor:
    """A sensor of the design."""

    rate_hz: float = required("its rate", unit="Hz", above=0, high=400)
    delay_ms: float = setting(0.0, "from the measurement to its arrival", unit="ms", low=0, high=300)
    used: bool = setting(True, "whether it is used")


def told_parameters(sensors: Mapping[str, Ekf2Sensor], parameters: Mapping[str, float]) -> dict[str, float]:
    """Parameters as a vehicle with these sensors would have them.

    Sensors sit at the IMU. EKF2 is told their delays, and looks back as far as the longest of those used takes, unless
    EKF2_DELAY_MAX is among the parameters. Values that the parameters do not have are PX4's defaults.
    """
    told = {name: metadata.default for name, metadata in PARAMETERS.items()} | dict(parameters)
    told |= {name: 0.0 for name in told if "_POS_" in name and name[-1] in "XYZ"} | NOISE_BY_PARAMETER
    used = {name: sensor for name, sensor in sensors.items() if sensor.used}
    for name in used:
        switches = [
            one.switch for one in AID_SOURCES.values() if one.sensor == name and one.switch and one.code is not None
        ]
        if not any(switch.is_on(told[switch.parameter]) for switch in switches):
            told |= {one.parameter: SWITCHED_ON[one.parameter] for one in switches if one.parameter in SWITCHED_ON}
    # EKF2 holds the delays of all sensors, also of those that are not there
    told |= {sensor.delay_parameter: 0.0 for sensor in SENSORS.values() if sensor.delay_parameter in told}
    told |= {SENSORS[name].delay_parameter: sensor.delay_ms for name, sensor in used.items()}
    if DELAY_MAX not in parameters:
        longest_ms = max((sensor.delay_ms for sensor in used.values()), default=0.0)
        told[DELAY_MAX] = max(LEAST_DELAY_MAX_MS, HORIZON_SHARE * longest_ms + HORIZON_MS)
    return told
