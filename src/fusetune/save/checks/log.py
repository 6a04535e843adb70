"""Checks of the log as a file: what of it made sense, which firmware wrote it, and how it was logged."""

from __future__ import annotations

from fusetune.check import Check, check
from fusetune.finding import Finding
from fusetune.px4.estimator_samples import is_complete, logged_share
from fusetune.px4.logger_settings import ESTIMATOR_REPLAY_BIT, MODES, logging_mode_of, logging_profile_of
from fusetune.px4.sensor_limits import LACKS_FIELD, NO_ADVANCE
from fusetune.px4.ulog.reading_limits import RAISE_LIMITS
from fusetune.px4.ulog.times import ANOTHER_CLOCK, IMPOSSIBLE
from fusetune.save.checks.judged_flight import BARO, IMU, IS_COMPLETE, MAG, JudgedFlight
from fusetune.save.checks.logging_advice import (
    COPY_AGAIN,
    FASTER_CARD,
    NEXT_FLIGHT_TOPICS,
    WHOLE_LOG,
    next_flight_settings,
)
from fusetune.save.log_facts import rate_hz

_CHECK_SENSORS = "Check the SD card and the sensors"
_TIME_REASONS = (IMPOSSIBLE, ANOTHER_CLOCK, NO_ADVANCE)
_THINNED_TOPICS = {"magnetometer": MAG, "barometer": BARO}
"""What PX4's default profile logs seldom."""


@check()
def readable(judged: JudgedFlight) -> Finding:
    """Whether the whole file made sense."""
    corruption = judged.flight.corruption
    if corruption:
        found = f"parts of the log are damaged ({'; '.join(corruption)})"
        return readable.warned(found, COPY_AGAIN, float(len(corruption)), 0.0)
    return readable.passed("the log is sound", 0.0, 0.0)


@check(topics=(IMU,))
def definitions(judged: JudgedFlight) -> Finding:
    """Whether the log defines the messages it holds."""
    missing = judged.flight.undefined_topics
    if not missing:
        return definitions.passed("all messages are defined", 0.0, 0.0)
    found = f"the log lacks the message definitions of {', '.join(missing[:8])}{' …' if len(missing) > 8 else ''}"
    lacks_imu = IMU in missing and not judged.flight.has(IMU)
    return (definitions.failed if lacks_imu else definitions.warned)(found, COPY_AGAIN, float(len(missing)), 0.0)


@check()
def tables(judged: JudgedFlight) -> Finding:
    """Whether all topics became tables, or only those that are used."""
    beyond = judged.flight.beyond_limits
    if not beyond:
        return tables.passed("all topics became tables", 0.0, 0.0)
    shown = f"{', '.join(beyond[:5])}{' …' if len(beyond) > 5 else ''}"
    found = f"the log has more topics than it may: {len(beyond)} of them did not become tables ({shown})"
    return tables.warned(found, RAISE_LIMITS, float(len(beyond)), 0.0)


@check(thresholds=("max_left_out_share",))
def time_stamps(judged: JudgedFlight) -> Finding:
    """Messages that were left out because their time cannot be."""
    return _left_out(time_stamps, judged, "time stamps", is_time=True)


@check(thresholds=("max_left_out_share",))
def sensor_values(judged: JudgedFlight) -> Finding:
    """Samples that were left out because what they hold cannot be."""
    return _left_out(sensor_values, judged, "values", is_time=False)


def _left_out(asked: Check[JudgedFlight], judged: JudgedFlight, what: str, *, is_time: bool) -> Finding:
    entries = [entry for entry in judged.flight.left_out if (entry.reason in _TIME_REASONS) == is_time]
    rows = sum(entry.rows for entry in entries)
    threshold = judged.limits.max_left_out_share
    if not rows and not entries:
        return asked.passed(f"no message has impossible {what}", 0.0, threshold)
    places = ", ".join(f"{entry.rows} of {entry.topic}: {entry.reason}" for entry in entries[:5])
    more = f" and {len(entries) - 5} topics more" if len(entries) > 5 else ""
    found = f"{rows} {'message' if rows == 1 else 'messages'} left out ({places}{more})"
    share = max((entry.rows / max(entry.total, 1) for entry in entries if entry.topic == IMU), default=0.0)
    remedy = WHOLE_LOG if all(entry.reason.startswith(LACKS_FIELD) for entry in entries) else _CHECK_SENSORS
    if share > threshold:
        return asked.failed(f"{share:.1%} of the IMU samples have impossible {what}: {found}", remedy, share, threshold)
    if all(entry.reason == ANOTHER_CLOCK for entry in entries):
        remedy = "Let what publishes it use the autopilot's time"
    return asked.warned(found, remedy, share, threshold)


@check()
def firmware(judged: JudgedFlight) -> Finding:
    """Whether the replay behaves like the firmware that flew."""
    replayed, flown = judged.replayed, judged.replayed.flown
    if flown.release is None:
        found = f"{flown.evidence}; the replay behaves like {replayed.name}"
        return firmware.warned(found, "Compare replays with each other, not with what the vehicle estimated")
    known = judged.flight.release_name
    flew = known if known.startswith(flown.name) else flown.name
    if flown.own_parameters:
        flew += f", a build with parameters of its own ({', '.join(flown.own_parameters[:3])}),"
    if replayed.flew and not flown.own_parameters:
        return firmware.passed(f"{flew} flew ({flown.evidence}), which is what the replay behaves like")
    if replayed.flew:
        found = f"{flew} flew, the replay behaves like {replayed.name} without what these do"
        return firmware.warned(found, "Compare the replay with what the vehicle estimated: the trust grade does")
    found = f"{flew} flew ({flown.evidence}), the replay behaves like {replayed.name}: {replayed.reason}"
    remedy = f"Parameters chosen here hold for {replayed.name}: fly that release, or test them with care"
    return firmware.warned(found, remedy)


@check(
    topics=(*IS_COMPLETE, *_THINNED_TOPICS.values(), *NEXT_FLIGHT_TOPICS),
    thresholds=tuple(f"low_{what}_rate_hz" for what in _THINNED_TOPICS),
)
def logging_profile(judged: JudgedFlight) -> Finding:
    """Whether the log holds every sample that the estimator had."""
    flight, settings = judged.flight, judged.flight.parameters.at_end()
    profile = logging_profile_of(settings)
    shares = {what: logged_share(flight, topic) for what, topic in _THINNED_TOPICS.items()}
    told = {what: share for what, share in shares.items() if share is not None}
    if told and all(is_complete(share) for share in told.values()):
        return logging_profile.passed(f"every sample of {' and '.join(told)} is in the log", float(profile))
    rates = {what: rate_hz(flight.topic(topic)) for what, topic in _THINNED_TOPICS.items()}
    full = all(rate is None or rate >= getattr(judged.limits, f"low_{what}_rate_hz") for what, rate in rates.items())
    for_replay = bool(profile & ESTIMATOR_REPLAY_BIT)
    if full and not told and (any(map(flight.has, IS_COMPLETE)) or for_replay):
        return logging_profile.passed("logged with the profile for estimator replay", float(profile))
    shown = ", ".join(f"{what} {rate:.1f} Hz" for what, rate in rates.items() if rate is not None)
    known = "" if "SDLOG_PROFILE" not in settings else f"SDLOG_PROFILE = {profile}, "
    if full and not told and shown:
        return logging_profile.passed(f"logged at the sensors' rates ({known}{shown})", float(profile))
    remedy = next_flight_settings(flight)
    if told:
        lost = ", ".join(f"{1.0 - share:.0%} of the {what}'s" for what, share in told.items() if not is_complete(share))
        found = f"the log lacks samples that the estimator had ({lost})"
        return logging_profile.warned(found, FASTER_CARD if for_replay else remedy, float(profile))
    if for_replay:
        found = f"few samples though the profile for estimator replay is set ({known}{shown or 'none'})"
        remedy = "Check the drivers and rates of these sensors, and that the SD card keeps up"
        return logging_profile.warned(found, remedy, float(profile))
    mode = logging_mode_of(settings)
    when = "" if mode is None else f"; logged {MODES.get(mode, 'otherwise')} (SDLOG_MODE = {mode})"
    found = f"logged with a thinned profile ({known}{shown or 'no magnetometer and barometer'}{when})"
    return logging_profile.warned(found, remedy, float(profile))
