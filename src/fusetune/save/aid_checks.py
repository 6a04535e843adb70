"""Checks of the sensors that aid the estimator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fusetune.px4.ekf2_parameters import complete
from fusetune.px4.flight import Flight, TopicTable
from fusetune.save.log_facts import rate_hz
from fusetune.save.logging_advice import log_more, slowness
from fusetune.save.magnetometer_mounting import magnetometer_mounting
from fusetune.save.verdict import Check, VerdictThresholds

_FIX_3D = 3
_MAG_TYPE_NONE = 5
_GPS_CTRL_HORIZONTAL, _GPS_CTRL_ALTITUDE, _EV_CTRL_HORIZONTAL, _EV_CTRL_HEIGHT = 0b101, 0b010, 0b101, 0b010
_BETTER_SKY = "Wait for a fix before take-off, with a free sky"
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
    rate = rate_hz(flight.topic("vehicle_magnetometer"))
    threshold = limits.low_magnetometer_rate_hz
    if rate is None:
        reason = "no magnetometer samples: the heading comes from other sources only"
        return Check("magnetometer", "warning", reason, log_more(flight, "vehicle_magnetometer"), 0.0, threshold)
    if rate < threshold:
        reason = slowness(flight, "vehicle_magnetometer", "magnetometer", rate)
        return Check("magnetometer", "warning", reason, log_more(flight, "vehicle_magnetometer"), rate, threshold)
    return Check("magnetometer", "pass", f"the magnetometer is logged at {rate:.1f} Hz", "", rate, threshold)


def barometer(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the height has a reference: the barometer, or another source that takes its place."""
    parameters = _parameters(flight)
    rate = rate_hz(flight.topic("vehicle_air_data"))
    threshold = limits.low_barometer_rate_hz
    if rate is not None and rate >= threshold:
        return Check("barometer", "pass", f"the barometer is logged at {rate:.1f} Hz", "", rate, threshold)
    if rate is not None:
        reason = slowness(flight, "vehicle_air_data", "barometer", rate)
        return Check("barometer", "warning", reason, log_more(flight, "vehicle_air_data"), rate, threshold)
    others = []
    if int(parameters["EKF2_GPS_CTRL"]) & _GPS_CTRL_ALTITUDE and _fix_share(flight) > 0.0:
        others.append("GNSS")
    if int(parameters["EKF2_EV_CTRL"]) & _EV_CTRL_HEIGHT and flight.topic("vehicle_visual_odometry") is not None:
        others.append("external vision")
    if parameters["EKF2_RNG_CTRL"] > 0 and flight.has("distance_sensor"):
        others.append("range finder")
    remedy = log_more(flight, "vehicle_air_data")
    if not others:
        return Check("barometer", "fail", "nothing in the log measures the height", remedy, 0.0, threshold)
    if not parameters["EKF2_BARO_CTRL"]:
        return Check("barometer", "does-not-apply", "EKF2_BARO_CTRL switches the barometer off")
    reason = f"no barometer samples; height from {', '.join(others)}"
    return Check("barometer", "warning", reason, remedy, 0.0, threshold)


def gnss(flight: Flight, limits: VerdictThresholds) -> Check:
    """Presence and rate of GNSS."""
    table, threshold = flight.topic("vehicle_gps_position"), limits.low_gnss_rate_hz
    if not int(_parameters(flight)["EKF2_GPS_CTRL"]):
        return Check("gnss", "does-not-apply", "EKF2_GPS_CTRL switches GNSS off")
    rate = rate_hz(table)
    if rate is None:
        return Check("gnss", "does-not-apply", "the log holds no GNSS samples")
    if rate < threshold:
        remedy = log_more(flight, "vehicle_gps_position")
        return Check("gnss", "warning", f"GNSS is logged at only {rate:.1f} Hz", remedy, rate, threshold)
    return Check("gnss", "pass", f"GNSS is logged at {rate:.1f} Hz", "", rate, threshold)


def gnss_fix(flight: Flight, limits: VerdictThresholds) -> Check:
    """Share of the GNSS samples that have a 3D fix."""
    name, threshold = "gnss_fix", limits.low_gnss_fix_share
    if not _uses_gnss(flight):
        return Check(name, "does-not-apply", "GNSS is switched off or not logged")
    share = _fix_share(flight)
    if share == 0.0:
        reason = "GNSS is logged but never has a 3D fix"
        return Check(name, "warning", reason, "Fly where satellites can be received", share, threshold)
    if share < threshold:
        return Check(name, "warning", f"GNSS has a 3D fix only {share:.0%} of the time", _BETTER_SKY, share, threshold)
    return Check(name, "pass", f"GNSS has a 3D fix {share:.0%} of the time", "", share, threshold)


def gnss_position_accuracy(flight: Flight, limits: VerdictThresholds) -> Check:
    """Horizontal accuracy that the receiver reports, median over the samples with a fix."""
    return _accuracy(flight, "gnss_position_accuracy", "eph", limits.high_gnss_eph_m, "m horizontally")


def gnss_height_accuracy(flight: Flight, limits: VerdictThresholds) -> Check:
    """Vertical accuracy that the receiver reports, median over the samples with a fix."""
    return _accuracy(flight, "gnss_height_accuracy", "epv", limits.high_gnss_epv_m, "m vertically")


def gnss_speed_accuracy(flight: Flight, limits: VerdictThresholds) -> Check:
    """Accuracy of the velocity that the receiver reports, median over the samples with a fix."""
    limit = limits.high_gnss_speed_error_m_s
    return _accuracy(flight, "gnss_speed_accuracy", "s_variance_m_s", limit, "m/s")


def _accuracy(flight: Flight, name: str, column: str, threshold: float, unit: str) -> Check:
    table = flight.topic("vehicle_gps_position")
    if table is None or not _uses_gnss(flight) or column not in table or not _fix_share(flight):
        return Check(name, "does-not-apply", "no GNSS samples with a fix and an accuracy")
    median = float(np.median(table[column][table["fix_type"] >= _FIX_3D]))
    said = f"the GNSS receiver reports an accuracy of {median:.1f} {unit}"
    if median > threshold:
        return Check(name, "warning", f"{said} (more than {threshold:g})", _BETTER_SKY, median, threshold)
    return Check(name, "pass", said, "", median, threshold)


def _uses_gnss(flight: Flight) -> bool:
    table = flight.topic("vehicle_gps_position")
    return bool(int(_parameters(flight)["EKF2_GPS_CTRL"]) and table is not None and len(table["timestamp"]))


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
        return Check(name, "warning", reason, log_more(flight, ""), 0.0, 1.0)
    receiver = flight.topic("vehicle_gps_position") is not None
    if receiver and int(_parameters(flight)["EKF2_GPS_CTRL"]) & _GPS_CTRL_HORIZONTAL:
        reason = "not replayable with GNSS: it never has a 3D fix, and nothing else aids the horizontal position"
        return Check(name, "fail", reason, "Fly where satellites can be received, or log the other aid", 0.0, 1.0)
    reason = "nothing in the log aids the horizontal position: only height, heading and tilt can be judged"
    return Check(name, "warning", reason, "Log GNSS, optical flow or external vision", 0.0, 1.0)


def _parameters(flight: Flight) -> dict[str, float]:
    return complete(flight.parameters.initial, {}, flight.release)


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
    columns = (table.get(f"{vector}[0]") for vector in ("position", "velocity"))
    return any(column is not None and bool(np.any(np.isfinite(column))) for column in columns)


def _onboard_aids(flight: Flight) -> list[str]:
    found: list[str] = []
    for instance in flight.instances("estimator_status_flags"):
        table = flight.topics["estimator_status_flags", instance]
        found += [aid for flag, aid in _ONBOARD_AIDS.items() if flag in table and np.any(table[flag])]
    return list(dict.fromkeys(found))


CHECKS: tuple[Callable[[Flight, VerdictThresholds], Check], ...] = (
    magnetometer,
    magnetometer_mounting,
    barometer,
    gnss,
    gnss_fix,
    gnss_position_accuracy,
    gnss_height_accuracy,
    gnss_speed_accuracy,
    horizontal_aid,
)
