"""Checks of the log as a file: what of it made sense, which firmware wrote it, and with which settings."""

from __future__ import annotations

import math
from collections.abc import Callable

from fusetune.px4.ekf2_parameters import BASELINE_RELEASE
from fusetune.px4.flight import Flight
from fusetune.px4.sensor_limits import LACKS_FIELD, NO_ADVANCE
from fusetune.save.log_facts import rate_hz
from fusetune.save.parameter_checks import parameter_values
from fusetune.save.verdict import Check, Status, VerdictThresholds

_CHECK_SENSORS = "Check the SD card and the sensors"
WHOLE_LOG = "Use the log as PX4 wrote it: what made or converted this file kept some fields only"
_COPY_AGAIN = "Copy the log from the vehicle again; check the SD card"
_IMU, _REPLAY_PROFILE_BIT, _DEFAULT_PROFILE_BIT = "sensor_combined", 0b10, 0b01
_TIME_REASONS = ("impossible time stamp", NO_ADVANCE)
_VERBOSE_SINCE = (1, 16, 0)
_MODES = {
    0: "while armed",
    1: "from boot to disarming",
    2: "from boot to shutdown",
    3: "by a switch",
    4: "from first arming to shutdown",
}
ONE_ESTIMATOR = "EKF2_MULTI_IMU = 0 and EKF2_MULTI_MAG = 0 with SENS_IMU_MODE = 1 and SENS_MAG_MODE = 1"
_DEVIATIONS = (
    ((1, 13, 99), "its EKF2 took the height from one source at a time and had its own logic for heading and GNSS"),
    ((1, 14, 99), "its EKF2 had another error state and fused the magnetometer's heading on its own"),
    ((1, 15, 99), "its EKF2 kept the terrain in a filter of its own and is else nearly the same"),
)
"""Last release, and how it differs from the one that is modelled."""


def readable(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the whole file made sense."""
    if flight.corruption:
        reason = f"parts of the log are damaged ({'; '.join(flight.corruption)})"
        return Check("readable", "warning", reason, _COPY_AGAIN, float(len(flight.corruption)), 0.0)
    return Check("readable", "pass", "the log is sound", "", 0.0, 0.0)


def definitions(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the log defines the messages it holds."""
    name, missing = "definitions", flight.undefined_topics
    if not missing:
        return Check(name, "pass", "all messages are defined", "", 0.0, 0.0)
    reason = f"the log lacks the message definitions of {', '.join(missing[:8])}{' …' if len(missing) > 8 else ''}"
    status: Status = "fail" if _IMU in missing and not flight.has(_IMU) else "warning"
    return Check(name, status, reason, _COPY_AGAIN, float(len(missing)), 0.0)


def time_stamps(flight: Flight, limits: VerdictThresholds) -> Check:
    """Messages that were left out because their time cannot be."""
    return _left_out(flight, limits, "time_stamps", "time stamps", is_time=True)


def sensor_values(flight: Flight, limits: VerdictThresholds) -> Check:
    """Samples that were left out because what they hold cannot be."""
    return _left_out(flight, limits, "sensor_values", "values", is_time=False)


def _left_out(flight: Flight, limits: VerdictThresholds, name: str, what: str, *, is_time: bool) -> Check:
    entries = [entry for entry in flight.left_out if (entry.reason in _TIME_REASONS) == is_time]
    rows = sum(entry.rows for entry in entries)
    threshold = limits.max_left_out_share
    if not rows and not entries:
        return Check(name, "pass", f"no message has impossible {what}", "", 0.0, threshold)
    places = ", ".join(f"{entry.rows} of {entry.topic}: {entry.reason}" for entry in entries[:5])
    more = f" and {len(entries) - 5} topics more" if len(entries) > 5 else ""
    reason = f"{rows} {'message' if rows == 1 else 'messages'} left out ({places}{more})"
    share = max((entry.rows / max(entry.total, 1) for entry in entries if entry.topic == _IMU), default=0.0)
    remedy = WHOLE_LOG if all(entry.reason.startswith(LACKS_FIELD) for entry in entries) else _CHECK_SENSORS
    if share > threshold:
        reason = f"{share:.1%} of the IMU samples have impossible {what}: {reason}"
        return Check(name, "fail", reason, remedy, share, threshold)
    return Check(name, "warning", reason, remedy, share, threshold)


def firmware(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the replay behaves like the firmware that flew."""
    name, baseline = "firmware", "v{}.{}".format(*BASELINE_RELEASE)
    release = flight.release
    if release is None:
        reason = f"the log does not say which release flew; the replay behaves like {baseline}"
        return Check(name, "warning", reason, "Compare replays with each other, not with what the vehicle estimated")
    if release[:2] == BASELINE_RELEASE:
        return Check(name, "pass", f"{flight.release_name} flew, which is what the replay behaves like")
    later = "its EKF2 is newer"
    how = next((words for last, words in _DEVIATIONS if release <= last), later)
    reason = f"{flight.release_name} flew, the replay behaves like {baseline}: {how}"
    remedy = f"Parameters chosen here hold for {baseline}: update the firmware, or test them with care"
    return Check(name, "warning", reason, remedy)


def logging_profile(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the log holds every sample that the estimator had."""
    name, settings = "logging_profile", flight.parameters.at_end()
    profile = _whole(settings.get("SDLOG_PROFILE"))
    rates = {
        "magnetometer": (rate_hz(flight.topic("vehicle_magnetometer")), limits.low_magnetometer_rate_hz),
        "barometer": (rate_hz(flight.topic("vehicle_air_data")), limits.low_barometer_rate_hz),
    }
    full = all(rate is None or rate >= threshold for rate, threshold in rates.values())
    if full and (flight.has("ekf2_timestamps") or profile & _REPLAY_PROFILE_BIT):
        return Check(name, "pass", "logged with the profile for estimator replay", "", float(profile))
    shown = ", ".join(f"{what} {rate:.1f} Hz" for what, (rate, _) in rates.items() if rate is not None)
    known = "" if "SDLOG_PROFILE" not in settings else f"SDLOG_PROFILE = {profile}, "
    if full and shown:
        return Check(name, "pass", f"logged at the sensors' rates ({known}{shown})", "", float(profile))
    mode = settings.get("SDLOG_MODE")
    when = "" if mode is None else f"; logged {_MODES.get(_whole(mode), 'otherwise')} (SDLOG_MODE = {mode:g})"
    reason = f"logged with a thinned profile ({known}{shown or 'no magnetometer and barometer'}{when})"
    return Check(name, "warning", reason, next_flight_settings(flight), float(profile))


def next_flight_settings(flight: Flight) -> str:
    """The parameters that make the log of the next flight replayable to the last sample."""
    profile = _whole(flight.parameters.at_end().get("SDLOG_PROFILE")) | _REPLAY_PROFILE_BIT | _DEFAULT_PROFILE_BIT
    advice = [f"SDLOG_PROFILE = {profile} (adds the set for estimator replay)", "SDLOG_MODE = 2 (log from boot)"]
    if len(flight.instances("estimator_status")) > 1 or flight.has("estimator_selector_status"):
        advice.append(f"{ONE_ESTIMATOR} (one estimator on one IMU)")
    if flight.release is None or flight.release >= _VERBOSE_SINCE:
        advice.append("EKF2_LOG_VERBOSE = 1")
    return f"For the next flight set {'; '.join(advice)}; then restart"


def _whole(value: float | None) -> int:
    """A whole parameter; 0 where it is missing or damaged."""
    return int(value) if value is not None and math.isfinite(value) else 0


CHECKS: tuple[Callable[[Flight, VerdictThresholds], Check], ...] = (
    readable,
    definitions,
    time_stamps,
    sensor_values,
    firmware,
    parameter_values,
    logging_profile,
)
