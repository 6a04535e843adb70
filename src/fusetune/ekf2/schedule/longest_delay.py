"""The longest delay that buffers must bridge, by which PX4 sizes them at start.

Mirrors `initialise_interface` of PX4 v1.13, v1.14 and v1.16 `EKF/estimator_interface.cpp`, and how `EKF2.cpp` finds the
longest interval of sensors.
"""

from __future__ import annotations

from collections.abc import Callable

from fusetune.ekf2.filter.common.aid_mask import MASK_FLOW, MASK_GNSS, MASK_POSITION, MASK_VELOCITY, MASK_YAW
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_NONE
from fusetune.ekf2.releases.behaviours import BEHAVIOURS
from fusetune.px4.aid_sources import SENSORS

LONGEST_SENSOR_INTERVAL_MS = 10.0

MASK_VISION = MASK_POSITION | MASK_YAW | MASK_VELOCITY
HEIGHT_BY_BARO, HEIGHT_BY_RANGE = 0, 2

Values = Callable[[str], float]
"""What a parameter is at start."""


def longest_delay_ms(values: Values, release: str) -> float:
    """The delay (ms) in a release, which until v1.14 follows from the sources that are asked for."""
    does = BEHAVIOURS[release]
    if not does.sizes_buffers_by_sources:
        return values("EKF2_DELAY_MAX")
    wanted = _wanted_by_mask(values) if does.selects_sources_by_mask else _wanted_by_control(values)
    delays = [values(SENSORS[sensor].delay_parameter or "") for sensor, is_wanted in wanted.items() if is_wanted]
    longest_interval = LONGEST_SENSOR_INTERVAL_MS
    if does.waits_for_averaged_sensors:
        longest_interval = _longest_interval_ms(values, wanted)
    return max(*delays, values("EKF2_AVEL_DELAY"), longest_interval)


def _wanted_by_control(values: Values) -> dict[str, bool]:
    return {
        "baro": int(values("EKF2_BARO_CTRL")) > 0,
        "airspeed": values("EKF2_ARSP_THR") > 0.0,
        "mag": int(values("EKF2_MAG_TYPE")) != MAG_TYPE_NONE,
        "range": int(values("EKF2_RNG_CTRL")) != 0,
        "gnss": int(values("EKF2_GPS_CTRL")) > 0,
        "flow": int(values("EKF2_OF_CTRL")) > 0,
        "ev": int(values("EKF2_EV_CTRL")) > 0,
    }


def _wanted_by_mask(values: Values) -> dict[str, bool]:
    mask, height = int(values("EKF2_AID_MASK")), int(values("EKF2_HGT_MODE"))
    return {
        "baro": height == HEIGHT_BY_BARO,
        "airspeed": values("EKF2_ARSP_THR") > 0.0,
        "mag": int(values("EKF2_MAG_TYPE")) != MAG_TYPE_NONE,
        "range": int(values("EKF2_RNG_AID")) != 0 or height == HEIGHT_BY_RANGE,
        "gnss": mask & MASK_GNSS != 0,
        "flow": mask & MASK_FLOW != 0,
        "ev": mask & MASK_VISION != 0,
    }


def _longest_interval_ms(values: Values, wanted: dict[str, bool]) -> float:
    """Between two samples of the barometer and the magnetometer, in whole milliseconds."""
    longest = LONGEST_SENSOR_INTERVAL_MS
    for sensor, rate in (("baro", "SENS_BARO_RATE"), ("mag", "SENS_MAG_RATE")):
        if wanted[sensor] and values(rate) > 0.0:
            longest = max(longest, float(int(1000.0 / values(rate) + 0.5)))
    return longest
