"""EKF2 parameters of older and newer releases in the names and the meaning of v1.16.

What each replacement means is what PX4 itself does when a vehicle with stored parameters is updated.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

_GPS, _OPTICAL_FLOW, _INHIBIT_ACCEL_BIAS, _VISION_POSITION, _VISION_YAW, _DRAG = (1 << bit for bit in range(6))
_GPS_YAW, _VISION_VELOCITY = 1 << 7, 1 << 8
"""Bits of EKF2_AID_MASK (releases before v1.14)."""

_GPS_CTRL_AIDING, _GPS_CTRL_HORIZONTAL, _GPS_CTRL_ALTITUDE, _GPS_CTRL_YAW = 0b0111, 0b0101, 0b0010, 0b1000
_EV_CTRL_POSITION, _EV_CTRL_HEIGHT, _EV_CTRL_VELOCITY, _EV_CTRL_YAW = 0b0011, 0b0010, 0b0100, 0b1000
_IMU_CTRL_DEFAULT, _IMU_CTRL_ACCEL_BIAS, _IMU_CTRL_BIASES = 0b111, 0b010, 0b011
_CONTROLS = ("EKF2_GPS_CTRL", "EKF2_OF_CTRL", "EKF2_EV_CTRL", "EKF2_DRAG_CTRL", "EKF2_IMU_CTRL")

_HEIGHT_GPS, _HEIGHT_RANGE, _HEIGHT_VISION = 1, 2, 3
"""Values of EKF2_HGT_MODE and EKF2_HGT_REF."""

SENSOR_PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "SENS_GPS0_DELAY": ("EKF2_GPS_DELAY",),
    "SENS_GPS0_OFFX": ("EKF2_GPS_POS_X",),
    "SENS_GPS0_OFFY": ("EKF2_GPS_POS_Y",),
    "SENS_GPS0_OFFZ": ("EKF2_GPS_POS_Z",),
}
"""Parameters that are none of EKF2's own and took over from one, in newer releases; with the same meaning and unit."""

OLDER_NAMES = ("EKF2_AID_MASK", "EKF2_HGT_MODE", "EKF2_RNG_AID", "EKF2_WIND_NOISE")
"""Parameters of v1.13 that became others."""

CHANGED = frozenset({"EKF2_WIND_NOISE", "EKF2_AID_MASK"})
"""Parameters that became others with another meaning, which `migrate_names` knows."""

_STEPS_TO_DENSITY = 10.0
"""From a standard deviation per step at 100 Hz to a noise density: the square root of the rate."""

_MAG_TYPE_AUTOMATIC, _MAG_TYPES_REMOVED = 0, (2, 3, 4)


def migrate_names(
    logged: Mapping[str, float | int], became: Mapping[str, Sequence[str]], *, keep_mag_type: bool = False
) -> dict[str, float | int]:
    """The logged parameters with those of v1.16 added where the log has only their predecessors.

    A parameter that the log holds under its v1.16 name is never overridden by a predecessor.

    Parameters
    ----------
    became : parameter of another release → those of v1.16 that stand for it
    keep_mag_type : for an estimator of v1.14 or before, which knows the kinds of EKF2_MAG_TYPE that v1.15 gave up
    """
    derived: dict[str, float | int] = {}
    for old, new_names in became.items():
        if old in logged and old not in CHANGED:
            derived.update(dict.fromkeys(new_names, logged[old]))
    if "EKF2_WIND_NOISE" in logged:
        derived["EKF2_WIND_NSD"] = float(logged["EKF2_WIND_NOISE"]) / _STEPS_TO_DENSITY
    if "EKF2_HGT_MODE" in logged and int(logged["EKF2_HGT_MODE"]) == _HEIGHT_RANGE:
        derived["EKF2_RNG_CTRL"] = 2
    if "EKF2_AID_MASK" in logged:
        derived.update(_controls_of_aid_mask(int(logged["EKF2_AID_MASK"]), int(logged.get("EKF2_HGT_MODE", 0))))
    migrated = derived | dict(logged)
    if not keep_mag_type and migrated.get("EKF2_MAG_TYPE") in _MAG_TYPES_REMOVED:
        migrated["EKF2_MAG_TYPE"] = _MAG_TYPE_AUTOMATIC
    return migrated


def older_values(values: Mapping[str, float], told: Container[str]) -> dict[str, float]:
    """`OLDER_NAMES` by which v1.13 comes nearest to parameters of v1.16, where it has no way to do the same.

    Parameters
    ----------
    values : all parameters in the names of v1.16
    told : names of those that say something; what none of these became another of is left out
    """
    found: dict[str, float] = {}
    if any(name in told for name in _CONTROLS):
        found["EKF2_AID_MASK"] = float(_nearest_aid_mask({name: int(values[name]) for name in _CONTROLS}))
    if "EKF2_HGT_REF" in told:
        found["EKF2_HGT_MODE"] = values["EKF2_HGT_REF"]
    if "EKF2_RNG_CTRL" in told:
        found["EKF2_RNG_AID"] = float(values["EKF2_RNG_CTRL"] >= 1)
    if "EKF2_WIND_NSD" in told:
        found["EKF2_WIND_NOISE"] = values["EKF2_WIND_NSD"] * _STEPS_TO_DENSITY
    return found


def _nearest_aid_mask(controls: Mapping[str, int]) -> int:
    """The mask that uses a sensor where its control uses part of it; heights are EKF2_HGT_MODE's."""
    gps, vision = controls["EKF2_GPS_CTRL"], controls["EKF2_EV_CTRL"]
    bits = {
        _GPS: gps & _GPS_CTRL_HORIZONTAL,
        _OPTICAL_FLOW: controls["EKF2_OF_CTRL"],
        _INHIBIT_ACCEL_BIAS: not controls["EKF2_IMU_CTRL"] & _IMU_CTRL_BIASES,
        _VISION_POSITION: vision & _EV_CTRL_POSITION & ~_EV_CTRL_HEIGHT,
        _VISION_YAW: vision & _EV_CTRL_YAW,
        _DRAG: controls["EKF2_DRAG_CTRL"],
        _GPS_YAW: gps & _GPS_CTRL_YAW,
        _VISION_VELOCITY: vision & _EV_CTRL_VELOCITY,
    }
    return sum(bit for bit, is_set in bits.items() if is_set)


def value_before(old: str, wanted: Mapping[str, float], logged: Mapping[str, float | int]) -> float | int | None:
    """The value of a parameter of another release by which those of v1.16 come out as wanted.

    Parameters
    ----------
    old : parameter of the other release
    wanted : some of the parameters that it tells, and their values
    logged : what the vehicle has, in its own names

    Returns
    -------
    None where no value of it does; whether others come out as they were is for the caller to see.
    """
    values = {float(value) for value in wanted.values()}
    if old == "EKF2_AID_MASK":
        return _aid_mask_of(wanted, int(logged.get(old, 0)), int(logged.get("EKF2_HGT_MODE", 0)))
    if len(values) > 1:
        return None
    return values.pop() * (_STEPS_TO_DENSITY if old == "EKF2_WIND_NOISE" else 1.0)


def _aid_mask_of(wanted: Mapping[str, float], mask: int, height_mode: int) -> int | None:
    """The mask nearest to the one that is set whose controls are as wanted, the others as they were."""
    asked = _controls_of_aid_mask(mask, height_mode) | {name: int(value) for name, value in wanted.items()}
    masks = sorted(range(2 * _VISION_VELOCITY), key=lambda other: ((other ^ mask).bit_count(), other))
    return next((other for other in masks if _controls_of_aid_mask(other, height_mode) == asked), None)


def _controls_of_aid_mask(mask: int, height_mode: int) -> dict[str, int]:
    """The control parameter of each aid source that EKF2_AID_MASK and EKF2_HGT_MODE amount to."""
    gps = _GPS_CTRL_AIDING if mask & _GPS else _GPS_CTRL_ALTITUDE if height_mode == _HEIGHT_GPS else 0
    if mask & _GPS_YAW:
        gps |= _GPS_CTRL_YAW
    vision = _EV_CTRL_POSITION if mask & _VISION_POSITION else 0
    if height_mode == _HEIGHT_VISION:
        vision |= _EV_CTRL_HEIGHT
    if mask & _VISION_VELOCITY:
        vision |= _EV_CTRL_VELOCITY
    if mask & _VISION_YAW:
        vision |= _EV_CTRL_YAW
    imu = _IMU_CTRL_DEFAULT & ~_IMU_CTRL_ACCEL_BIAS if mask & _INHIBIT_ACCEL_BIAS else _IMU_CTRL_DEFAULT
    return {
        "EKF2_GPS_CTRL": gps,
        "EKF2_OF_CTRL": int(bool(mask & _OPTICAL_FLOW)),
        "EKF2_EV_CTRL": vision,
        "EKF2_DRAG_CTRL": int(bool(mask & _DRAG)),
        "EKF2_IMU_CTRL": imu,
    }
