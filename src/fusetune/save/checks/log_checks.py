"""Checks of the log as a file: what of it made sense, which firmware wrote it, and with which settings."""

from __future__ import annotations

from collections.abc import Callable

from fusetune.px4.estimator_samples import is_complete, logged_share
from fusetune.px4.flight import Flight
from fusetune.px4.logger_settings import ESTIMATOR_REPLAY_BIT, MODES, logging_mode_of, logging_profile_of
from fusetune.px4.parameters.ekf2_parameters import BASELINE_RELEASE
from fusetune.px4.sensor_limits import LACKS_FIELD, NO_ADVANCE
from fusetune.px4.ulog.reading_limits import RAISE_LIMITS
from fusetune.px4.ulog.times import ANOTHER_CLOCK, IMPOSSIBLE
from fusetune.save.checks.check import Check, Status
from fusetune.save.checks.logging_advice import FASTER_CARD, next_flight_settings
from fusetune.save.checks.parameter_checks import parameter_values
from fusetune.save.log_facts import rate_hz
from fusetune.save.thresholds import VerdictThresholds

_CHECK_SENSORS = "Check the SD card and the sensors"
WHOLE_LOG = "Use the log as PX4 wrote it: what made or converted this file kept some fields only"
_COPY_AGAIN = "Copy the log from the vehicle again; check the SD card"
_IMU = "sensor_combined"
_TIME_REASONS = (IMPOSSIBLE, ANOTHER_CLOCK, NO_ADVANCE)
_THINNED_TOPICS = {"magnetometer": "vehicle_magnetometer", "barometer": "vehicle_air_data"}
"""What PX4's default profile logs seldom."""
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


def tables(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether all topics became tables, or only those that are used."""
    name, beyond = "tables", flight.beyond_limits
    if not beyond:
        return Check(name, "pass", "all topics became tables", "", 0.0, 0.0)
    shown = f"{', '.join(beyond[:5])}{' …' if len(beyond) > 5 else ''}"
    reason = f"the log has more topics than it may: {len(beyond)} of them did not become tables ({shown})"
    return Check(name, "warning", reason, RAISE_LIMITS, float(len(beyond)), 0.0)


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
    if all(entry.reason == ANOTHER_CLOCK for entry in entries):
        remedy = "Let what publishes it use the autopilot's time"
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
    profile = logging_profile_of(settings)
    shares = {what: logged_share(flight, topic) for what, topic in _THINNED_TOPICS.items()}
    told = {what: share for what, share in shares.items() if share is not None}
    if told and all(is_complete(share) for share in told.values()):
        return Check(name, "pass", f"every sample of {' and '.join(told)} is in the log", "", float(profile))
    rates = {what: rate_hz(flight.topic(topic)) for what, topic in _THINNED_TOPICS.items()}
    full = all(rate is None or rate >= getattr(limits, f"low_{what}_rate_hz") for what, rate in rates.items())
    for_replay = bool(profile & ESTIMATOR_REPLAY_BIT)
    if full and not told and (flight.has("ekf2_timestamps") or for_replay):
        return Check(name, "pass", "logged with the profile for estimator replay", "", float(profile))
    shown = ", ".join(f"{what} {rate:.1f} Hz" for what, rate in rates.items() if rate is not None)
    known = "" if "SDLOG_PROFILE" not in settings else f"SDLOG_PROFILE = {profile}, "
    if full and not told and shown:
        return Check(name, "pass", f"logged at the sensors' rates ({known}{shown})", "", float(profile))
    remedy = next_flight_settings(flight)
    if told:
        lost = ", ".join(f"{1.0 - share:.0%} of the {what}'s" for what, share in told.items() if not is_complete(share))
        reason = f"the log lacks samples that the estimator had ({lost})"
        return Check(name, "warning", reason, FASTER_CARD if for_replay else remedy, float(profile))
    if for_replay:
        reason = f"few samples though the profile for estimator replay is set ({known}{shown or 'none'})"
        remedy = "Check the drivers and rates of these sensors, and that the SD card keeps up"
        return Check(name, "warning", reason, remedy, float(profile))
    mode = logging_mode_of(settings)
    when = "" if mode is None else f"; logged {MODES.get(mode, 'otherwise')} (SDLOG_MODE = {mode})"
    reason = f"logged with a thinned profile ({known}{shown or 'no magnetometer and barometer'}{when})"
    return Check(name, "warning", reason, remedy, float(profile))


CHECKS: tuple[Callable[[Flight, VerdictThresholds], Check], ...] = (
    readable,
    definitions,
    tables,
    time_stamps,
    sensor_values,
    firmware,
    parameter_values,
    logging_profile,
)
