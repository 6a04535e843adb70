"""Parameters of the simulated vehicle as its log holds them."""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.execute.vehicle import Vehicle
from fusetune.px4.flight import ParameterHistory, ParameterValue
from fusetune.px4.logger_settings import DEFAULT_SET_BIT, FROM_BOOT, PROFILE_FOR_REPLAY, WHEN_ARMED
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, check_value

SYSTEM_PARAMETERS: dict[str, ParameterValue] = {
    "MAV_TYPE": 2,
    "SDLOG_MODE": FROM_BOOT,
    "SDLOG_PROFILE": PROFILE_FOR_REPLAY,
    "SENS_BARO_QNH": 1013.25,
    "SENS_IMU_MODE": 1,
    "SENS_MAG_MODE": 1,
    "SYS_AUTOSTART": 4001,
    "SYS_HAS_BARO": 1,
    "SYS_HAS_GPS": 1,
    "SYS_HAS_MAG": 1,
}
"""What is set on the vehicle beside EKF2."""
SYSTEM_DEFAULTS: dict[str, ParameterValue] = SYSTEM_PARAMETERS | {
    "SDLOG_MODE": WHEN_ARMED,
    "SDLOG_PROFILE": DEFAULT_SET_BIT,
    "SYS_AUTOSTART": 0,
}


def flown_parameters(vehicle: Vehicle, overrides: Mapping[str, float], *, default_profile: bool) -> ParameterHistory:
    """Parameters of a flight: defaults of PX4 v1.16, those of the vehicle, and the flown set.

    Raises
    ------
    ParameterError
        An override is unknown, of the wrong type or out of range.
    """
    for name, value in overrides.items():
        check_value(name, value)
    values = {name: metadata.default for name, metadata in PARAMETERS.items()}
    defaults = _typed(values) | SYSTEM_DEFAULTS
    initial = _typed(values | vehicle.parameters | dict(overrides)) | SYSTEM_PARAMETERS
    if default_profile:
        initial |= {"SDLOG_MODE": SYSTEM_DEFAULTS["SDLOG_MODE"], "SDLOG_PROFILE": SYSTEM_DEFAULTS["SDLOG_PROFILE"]}
    return ParameterHistory(initial=initial, default_system=defaults, default_current_setup=dict(defaults))


def _typed(values: Mapping[str, float]) -> dict[str, ParameterValue]:
    return {
        name: int(value) if PARAMETERS[name].type == "INT32" else float(value) for name, value in sorted(values.items())
    }
