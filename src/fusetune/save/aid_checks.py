"""Checks of the sensors that aid the estimator, and of the flight itself."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fusetune.px4.ekf2_parameters import complete
from fusetune.px4.flight import Flight, TopicTable
from fusetune.save.log_facts import flight_times
from fusetune.save.verdict import Check, VerdictThresholds

_FIX_3D = 3
_MAG_TYPE_NONE = 5
_GPS_CTRL_HORIZONTAL, _GPS_CTRL_ALTITUDE, _EV_CTRL_HORIZONTAL, _EV_CTRL_HEIGHT = 0b101, 0b010, 0b101, 0b010
_LOG_MORE = "Log with SDLOG_PROFILE bit 1 (estimator replay) set"
_ONBOARD_AIDS = {
    "cs_gnss_pos": "GNSS",
    "cs_ev_pos": "external vision",
    "cs_ev_vel": "external vision",
    "cs_opt_flow": "optical flow",
    "cs_aux_gpos": "an auxiliary position",
}
"""Control flags of the vehicle's own estimator that stand for horizontal aiding."""


def magnetometer(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the heading has its usual reference."""
    if _parameters(flight)["EKF2_MAG_TYPE"] == _MAG_TYPE_NONE:
        return Check("magnetometer", "does-not-apply", "EKF2_MAG_TYPE switches the magnetometer off")
    rate = _rate_hz(flight.topic("vehicle_magnetometer"))
    threshold = limits.low_magnetometer_rate_hz
    if rate is None:
        reason = "no magnetometer samples: the heading comes from other sources only"
        return Check("magnetometer", "warning", reason, _LOG_MORE, 0.0, threshold)
    if rate < threshold:
        reason = f"the magnetometer is logged at only {rate:.1f} Hz"
        return Check("magnetometer", "warning", reason, _LOG_MORE, rate, threshold)
    return Check("magnetometer", "pass", f"the magnetometer is logged at {rate:.1f} Hz", "", rate, threshold)


def barometer(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the height has a reference: the barometer, or another source that takes its place."""
    parameters = _parameters(flight)
    rate = _rate_hz(flight.topic("vehicle_air_data"))
    threshold = limits.low_barometer_rate_hz
    if rate is not None and rate >= threshold:
        return Check("barometer", "pass", f"the barometer is logged at {rate:.1f} Hz", "", rate, threshold)
    if rate is not None:
        return Check(
            "barometer", "warning", f"the barometer is logged at only {rate:.1f} Hz", _LOG_MORE, rate, threshold
        )
    others = []
    if int(parameters["EKF2_GPS_CTRL"]) & _GPS_CTRL_ALTITUDE and _fix_share(flight) > 0.0:
        others.append("GNSS")
    if int(parameters["EKF2_EV_CTRL"]) & _EV_CTRL_HEIGHT and flight.topic("vehicle_visual_odometry") is not None:
        others.append("external vision")
    if parameters["EKF2_RNG_CTRL"] > 0 and flight.has("distance_sensor"):
        others.append("range finder")
    if not others:
        return Check("barometer", "fail", "nothing in the log measures the height", _LOG_MORE, 0.0, threshold)
    if not parameters["EKF2_BARO_CTRL"]:
        return Check("barometer", "does-not-apply", "EKF2_BARO_CTRL switches the barometer off")
    return Check(
        "barometer", "warning", f"no barometer samples; height from {', '.join(others)}", _LOG_MORE, 0.0, threshold
    )


def gnss(flight: Flight, limits: VerdictThresholds) -> Check:
    """Rate and fix of GNSS."""
    table = flight.topic("vehicle_gps_position")
    if not int(_parameters(flight)["EKF2_GPS_CTRL"]):
        return Check("gnss", "does-not-apply", "EKF2_GPS_CTRL switches GNSS off")
    if table is None:
        return Check("gnss", "does-not-apply", "the log holds no GNSS samples")
    share, rate = _fix_share(flight), _rate_hz(table) or 0.0
    if share == 0.0:
        reason = "GNSS is logged but never has a 3D fix"
        return Check(
            "gnss", "warning", reason, "Fly where satellites can be received", share, limits.low_gnss_fix_share
        )
    if share < limits.low_gnss_fix_share:
        reason = f"GNSS has a 3D fix only {share:.0%} of the time"
        remedy = "Wait for a fix before take-off"
        return Check("gnss", "warning", reason, remedy, share, limits.low_gnss_fix_share)
    if rate < limits.low_gnss_rate_hz:
        reason = f"GNSS is logged at only {rate:.1f} Hz"
        return Check("gnss", "warning", reason, _LOG_MORE, rate, limits.low_gnss_rate_hz)
    return Check("gnss", "pass", f"GNSS is logged at {rate:.1f} Hz with a fix", "", rate, limits.low_gnss_rate_hz)


def horizontal_aid(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether anything in the log can hold the horizontal position or velocity.

    A flight that was meant to be aided by GNSS and never got a fix is refused; one that flew unaided, or whose aiding
    the log does not hold, still has heights, heading and tilt to judge.
    """
    name = "horizontal_aid"
    aids = _horizontal_aids(flight)
    if aids:
        return Check(name, "pass", f"horizontal aiding by {', '.join(aids)}", "", float(len(aids)), 1.0)
    onboard = _onboard_aids(flight)
    if onboard:
        reason = f"the vehicle was aided by {', '.join(onboard)}, whose samples the log lacks: no horizontal aiding"
        return Check(name, "warning", reason, _LOG_MORE, 0.0, 1.0)
    receiver = flight.topic("vehicle_gps_position") is not None
    if receiver and int(_parameters(flight)["EKF2_GPS_CTRL"]) & _GPS_CTRL_HORIZONTAL:
        reason = "not replayable with GNSS: it never has a 3D fix, and nothing else aids the horizontal position"
        return Check(name, "fail", reason, "Fly where satellites can be received, or log the other aid", 0.0, 1.0)
    reason = "nothing in the log aids the horizontal position: only height, heading and tilt can be judged"
    return Check(name, "warning", reason, "Log GNSS, optical flow or external vision", 0.0, 1.0)


def airborne(flight: Flight, limits: VerdictThresholds) -> Check:
    """Time in the air."""
    seconds = flight_times(flight).airborne_s
    if seconds is None:
        return Check("airborne", "does-not-apply", "the log has no land detector")
    if seconds < limits.low_airborne_s:
        reason = f"airborne for {seconds:.0f} s only" if seconds > 0.0 else "never airborne"
        remedy = "Log a flight; on the ground a filter shows little"
        return Check("airborne", "warning", reason, remedy, seconds, limits.low_airborne_s)
    return Check("airborne", "pass", f"airborne for {seconds:.0f} s", "", seconds, limits.low_airborne_s)


def _parameters(flight: Flight) -> dict[str, float]:
    return complete(flight.parameters.initial, {}, flight.release)


def _rate_hz(table: TopicTable | None) -> float | None:
    """Mean rate of a topic; `None` where there are no samples."""
    if table is None or not len(table["timestamp"]):
        return None
    span = float(table["timestamp"].max() - table["timestamp"].min()) * 1e-6
    return (len(table["timestamp"]) - 1) / span if span > 0.0 else 0.0


def _fix_share(flight: Flight) -> float:
    table = flight.topic("vehicle_gps_position")
    if table is None or "fix_type" not in table or not len(table["fix_type"]):
        return 0.0
    return float(np.mean(table["fix_type"] >= _FIX_3D))


def _horizontal_aids(flight: Flight) -> list[str]:
    parameters = _parameters(flight)
    aids = []
    if int(parameters["EKF2_GPS_CTRL"]) & _GPS_CTRL_HORIZONTAL and _fix_share(flight) > 0.0:
        aids.append("GNSS")
    if int(parameters["EKF2_EV_CTRL"]) & _EV_CTRL_HORIZONTAL and _has_vision(flight.topic("vehicle_visual_odometry")):
        aids.append("external vision")
    if parameters["EKF2_OF_CTRL"] and flight.topic("vehicle_optical_flow") is not None:
        aids.append("optical flow")
    if int(parameters["EKF2_AGP_CTRL"]) and flight.topic("aux_global_position") is not None:
        aids.append("an auxiliary position")
    return aids


def _has_vision(table: TopicTable | None) -> bool:
    """Whether any message holds a position or a velocity."""
    if table is None:
        return False
    return any(bool(np.any(np.isfinite(table[f"{vector}[0]"]))) for vector in ("position", "velocity"))


def _onboard_aids(flight: Flight) -> list[str]:
    found: list[str] = []
    for instance in flight.instances("estimator_status_flags"):
        table = flight.topics["estimator_status_flags", instance]
        found += [aid for flag, aid in _ONBOARD_AIDS.items() if flag in table and np.any(table[flag])]
    return list(dict.fromkeys(found))


CHECKS: tuple[Callable[[Flight, VerdictThresholds], Check], ...] = (
    magnetometer,
    barometer,
    gnss,
    horizontal_aid,
    airborne,
)
