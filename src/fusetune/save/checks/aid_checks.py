"""Checks of the sensors that aid the estimator."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fusetune.ekf2.feed.given_samples import GivenSamples, given_samples
from fusetune.ekf2.feed.message_samples import gnss_refusals, taken
from fusetune.px4.aid_sources import AID_SOURCES, SENSORS, AidSource
from fusetune.px4.flight import Flight, LeftOut, row_count
from fusetune.px4.parameters.ekf2_parameters import complete
from fusetune.px4.sensor_limits import LACKS_FIELD
from fusetune.save.checks.check import Check
from fusetune.save.checks.log_checks import WHOLE_LOG
from fusetune.save.checks.logging_advice import log_more, slowness
from fusetune.save.checks.magnetometer_mounting import magnetometer_mounting
from fusetune.save.log_facts import rate_hz
from fusetune.save.thresholds import VerdictThresholds

_FIX_3D = 3
_GNSS, _MAG, _BARO = (SENSORS[name].topics[0].name for name in ("gnss", "mag", "baro"))
_DROPPED = "Mend what the sensor's driver reports, or switch the sensor off"
_BETTER_SKY = "Wait for a fix before take-off, with a free sky"
_HEIGHTS = tuple(one for one in AID_SOURCES.values() if one.sensor and one.quantity == "height")
_HORIZONTAL_AIDS = tuple(one for one in AID_SOURCES.values() if one.stops_drift and one.flags)
"""Auxiliary velocity, which has no flag, is fused only beside another of them."""

_ONBOARD_AIDS = {flag: SENSORS[one.sensor].label for one in _HORIZONTAL_AIDS for flag in one.flags}
"""Control flags of the vehicle's own estimator that stand for horizontal aiding."""


@dataclass(frozen=True)
class _Aids:
    """What the checks below share of one flight."""

    flight: Flight
    limits: VerdictThresholds
    parameters: dict[str, float]

    @cached_property
    def given(self) -> dict[str, GivenSamples]:
        return given_samples(self.flight)

    def is_given(self, *sensors: str) -> bool:
        """Whether the estimator is given a sample of any of these sensors."""
        return any(sensor in self.given and self.given[sensor].given for sensor in sensors)

    def is_switched_on(self, part: str) -> bool:
        """Whether a source of some samples, by the name of their sensor or part of it, may be fused."""
        sources = [one for one in AID_SOURCES.values() if one.code is not None and part in (one.sensor, one.part)]
        return any(map(self.may_fuse, sources))

    def may_fuse(self, source: AidSource) -> bool:
        """Whether the parameters let a source be fused."""
        return source.switch is None or source.switch.is_on(self.parameters[source.switch.parameter])

    def has_samples(self, source: AidSource) -> bool:
        """Whether the log holds samples that a source can be made of."""
        if source.sensor == "gnss":
            return bool(self.usable_fixes)
        if not SENSORS[source.sensor].buffered:
            return any(self.flight.topic(topic.name) is not None for topic in SENSORS[source.sensor].topics)
        return self.is_given(source.part or source.sensor)

    def from_sensors(self, sources: Iterable[AidSource]) -> list[str]:
        """Labels of the sensors, as each of some sources has its samples and may be fused."""
        labels = (SENSORS[one.sensor].label for one in sources if self.may_fuse(one) and self.has_samples(one))
        return list(dict.fromkeys(labels))

    def lacks_fields(self, topic: str) -> LeftOut | None:
        """The topic as it was left out, since it lacks a field that the estimator needs."""
        entries = (entry for entry in self.flight.left_out if entry.topic == topic and not self.flight.has(topic))
        return next((entry for entry in entries if entry.reason.startswith(LACKS_FIELD)), None)

    def why_no_samples(self, topic: str, words: str) -> tuple[str, str]:
        """Why there are no messages of a topic, and the remedy."""
        entry = self.lacks_fields(topic)
        if entry is None:
            return f"no {words} samples", log_more(self.flight, topic)
        return f"no {words} samples that can be used (each {entry.reason})", WHOLE_LOG

    @property
    def uses_gnss(self) -> bool:
        table = self.flight.topic(_GNSS)
        return self.is_switched_on("gnss") and table is not None and bool(len(table["timestamp"]))

    @cached_property
    def fix_share(self) -> float:
        """Share of the GNSS samples that have a 3D fix."""
        table = self.flight.topic(_GNSS)
        return 0.0 if table is None or not row_count(table) else float(np.mean(table["fix_type"] >= _FIX_3D))

    @cached_property
    def usable_fixes(self) -> int:
        """GNSS samples with a 3D fix that the estimator is given."""
        table = self.flight.topic(_GNSS)
        if table is None or not self.is_given("gnss"):
            return 0
        usable = taken(table, gnss_refusals(table, self.flight.release))
        return int(np.sum(usable & (table["fix_type"] >= _FIX_3D)))


def checks(flight: Flight, limits: VerdictThresholds) -> list[Check]:
    """All checks of this module on a flight that has IMU samples."""
    aids = _Aids(flight, limits, complete(flight.parameters.initial, {}, flight.release))
    return [check(aids) for check in CHECKS]


def magnetometer(aids: _Aids) -> Check:
    """Whether the heading has its usual reference."""
    name, threshold = "magnetometer", aids.limits.low_magnetometer_rate_hz
    if not aids.is_switched_on("mag"):
        return Check(name, "does-not-apply", "EKF2_MAG_TYPE switches the magnetometer off")
    rate = rate_hz(aids.flight.topic(_MAG))
    if rate is None:
        why, remedy = aids.why_no_samples(_MAG, "magnetometer")
        return Check(name, "warning", f"{why}: the heading comes from other sources only", remedy, 0.0, threshold)
    if rate < threshold:
        reason = slowness(aids.flight, _MAG, "magnetometer", rate)
        return Check(name, "warning", reason, log_more(aids.flight, _MAG), rate, threshold)
    return Check(name, "pass", f"the magnetometer is logged at {rate:.1f} Hz", "", rate, threshold)


def mounting(aids: _Aids) -> Check:
    """Whether the magnetometer sits as its parameters say."""
    return magnetometer_mounting(aids.flight, aids.limits)


def barometer(aids: _Aids) -> Check:
    """Whether the height has a reference: the barometer, or another source that takes its place."""
    name, threshold = "barometer", aids.limits.low_barometer_rate_hz
    rate = rate_hz(aids.flight.topic(_BARO))
    if rate is not None and rate >= threshold:
        return Check(name, "pass", f"the barometer is logged at {rate:.1f} Hz", "", rate, threshold)
    if rate is not None:
        reason = slowness(aids.flight, _BARO, "barometer", rate)
        return Check(name, "warning", reason, log_more(aids.flight, _BARO), rate, threshold)
    others = aids.from_sensors(one for one in _HEIGHTS if one.sensor != "baro")
    why, remedy = aids.why_no_samples(_BARO, "barometer")
    if not others:
        said = "nothing in the log measures the height"
        reason = f"{said} ({why})" if aids.lacks_fields(_BARO) else said
        return Check(name, "fail", reason, remedy, 0.0, threshold)
    if not aids.is_switched_on("baro"):
        return Check(name, "does-not-apply", "EKF2_BARO_CTRL switches the barometer off")
    return Check(name, "warning", f"{why}; height from {', '.join(others)}", remedy, 0.0, threshold)


def gnss(aids: _Aids) -> Check:
    """Presence and rate of GNSS, and whether the estimator is given it."""
    name, threshold = "gnss", aids.limits.low_gnss_rate_hz
    if not aids.is_switched_on("gnss"):
        return Check(name, "does-not-apply", "EKF2_GPS_CTRL switches GNSS off")
    rate = rate_hz(aids.flight.topic(_GNSS))
    if rate is None:
        why, remedy = aids.why_no_samples(_GNSS, "GNSS")
        if not aids.lacks_fields(_GNSS):
            return Check(name, "does-not-apply", "the log holds no GNSS samples")
        return Check(name, "warning", why, remedy, 0.0, threshold)
    one = aids.given["gnss"]
    share = 1.0 - max((rows for _, rows in one.refused), default=0) / one.messages
    if share < aids.limits.low_gnss_fix_share:
        reason = f"{_told(one)}, at {rate:.1f} Hz"
        return Check(name, "warning", reason, _DROPPED, share, aids.limits.low_gnss_fix_share)
    if rate < threshold:
        reason = f"GNSS is logged at only {rate:.1f} Hz"
        return Check(name, "warning", reason, log_more(aids.flight, _GNSS), rate, threshold)
    return Check(name, "pass", f"GNSS is logged at {rate:.1f} Hz", "", rate, threshold)


def gnss_fix(aids: _Aids) -> Check:
    """Share of the GNSS samples that have a 3D fix."""
    name, threshold, share = "gnss_fix", aids.limits.low_gnss_fix_share, aids.fix_share
    if not aids.uses_gnss:
        return Check(name, "does-not-apply", "GNSS is switched off or not logged")
    if share == 0.0:
        reason = "GNSS is logged but never has a 3D fix"
        return Check(name, "warning", reason, "Fly where satellites can be received", share, threshold)
    if share < threshold:
        return Check(name, "warning", f"GNSS has a 3D fix only {share:.0%} of the time", _BETTER_SKY, share, threshold)
    return Check(name, "pass", f"GNSS has a 3D fix {share:.0%} of the time", "", share, threshold)


def gnss_position_accuracy(aids: _Aids) -> Check:
    """Horizontal accuracy that the receiver reports, median over the samples with a fix."""
    return _accuracy(aids, "gnss_position_accuracy", "eph", aids.limits.high_gnss_eph_m, "m horizontally")


def gnss_height_accuracy(aids: _Aids) -> Check:
    """Vertical accuracy that the receiver reports, median over the samples with a fix."""
    return _accuracy(aids, "gnss_height_accuracy", "epv", aids.limits.high_gnss_epv_m, "m vertically")


def gnss_speed_accuracy(aids: _Aids) -> Check:
    """Accuracy of the velocity that the receiver reports, median over the samples with a fix."""
    limit = aids.limits.high_gnss_speed_error_m_s
    return _accuracy(aids, "gnss_speed_accuracy", "s_variance_m_s", limit, "m/s")


def _accuracy(aids: _Aids, name: str, column: str, threshold: float, unit: str) -> Check:
    table = aids.flight.topic(_GNSS)
    if table is None or not aids.uses_gnss or not aids.fix_share:
        return Check(name, "does-not-apply", "no GNSS samples with a fix and an accuracy")
    median = float(np.median(table[column][table["fix_type"] >= _FIX_3D]))
    said = f"the GNSS receiver reports an accuracy of {median:.1f} {unit}"
    if median > threshold:
        return Check(name, "warning", f"{said} (more than {threshold:g})", _BETTER_SKY, median, threshold)
    return Check(name, "pass", said, "", median, threshold)


def horizontal_aid(aids: _Aids) -> Check:
    """Whether anything that the estimator is given can hold the horizontal position or velocity.

    A flight that was meant to be aided by GNSS and never got a fix is refused; one that flew unaided, or whose aiding
    the log does not hold, still has heights, heading and tilt to judge.
    """
    name = "horizontal_aid"
    found = aids.from_sensors(_HORIZONTAL_AIDS)
    if found:
        return Check(name, "pass", f"horizontal aiding by {', '.join(found)}", "", float(len(found)), 1.0)
    onboard = _onboard_aids(aids.flight)
    flown = f"the vehicle was aided by {', '.join(onboard)}" if onboard else ""
    never_fixed = (
        any(one.sensor == "gnss" and aids.may_fuse(one) for one in _HORIZONTAL_AIDS)
        and aids.flight.topic(_GNSS) is not None
        and not aids.fix_share
    )
    unusable = list(_unusable_aids(aids))
    if never_fixed and not onboard:
        reason = "not replayable with GNSS: it never has a 3D fix, and nothing else aids the horizontal position"
        others = "; ".join(why for sensor, why, _ in unusable if sensor != "gnss")
        reason = f"{reason} ({others})" if others else reason
        return Check(name, "fail", reason, "Fly where satellites can be received, or log the other aid", 0.0, 1.0)
    if unusable:
        reason = f"no horizontal aiding: {'; '.join(why for _, why, _ in unusable)}{f'; {flown}' if flown else ''}"
        return Check(name, "warning", reason, unusable[0][2], 0.0, 1.0)
    if onboard:
        reason = f"{flown}, whose samples the log lacks: no horizontal aiding"
        return Check(name, "warning", reason, log_more(aids.flight, ""), 0.0, 1.0)
    reason = "nothing in the log aids the horizontal position: only height, heading and tilt can be judged"
    return Check(name, "warning", reason, "Log GNSS, optical flow or external vision", 0.0, 1.0)


def _unusable_aids(aids: _Aids) -> Iterator[tuple[str, str, str]]:
    """Horizontal aids that are switched on and logged, but not given to the estimator; why not, and the remedy."""
    told = set()
    switched_on = {one.part or one.sensor: SENSORS[one.sensor] for one in _HORIZONTAL_AIDS if aids.may_fuse(one)}
    for part, sensor in switched_on.items():
        topic = sensor.topics[0].name
        if aids.lacks_fields(topic) and topic not in told:
            told.add(topic)
            yield part, *aids.why_no_samples(topic, sensor.label)
        elif part in aids.given and aids.given[part].is_withheld:
            yield part, _told(aids.given[part]), _DROPPED


def _onboard_aids(flight: Flight) -> list[str]:
    found: list[str] = []
    for instance in flight.instances("estimator_status_flags"):
        table = flight.topics["estimator_status_flags", instance]
        found += [aid for flag, aid in _ONBOARD_AIDS.items() if flag in table and np.any(table[flag])]
    return list(dict.fromkeys(found))


def samples_given(aids: _Aids) -> Check:
    """How many samples of each sensor in use the estimator is given, and why not the others."""
    name = "samples_given"
    used = [one for sensor, one in aids.given.items() if aids.is_switched_on(sensor)]
    if not used:
        return Check(name, "does-not-apply", "the log holds no messages of a sensor in use")
    withheld = [one for one in used if one.is_withheld and one.sensor != "gnss"]
    if withheld:
        return Check(name, "warning", "; ".join(map(_told, withheld)), _DROPPED, float(len(withheld)), 0.0)
    counts = ", ".join(_count(one) for one in used)
    return Check(name, "pass", f"the estimator is given {counts}", "", 0.0, 0.0)


def _words(part: str) -> str:
    """What samples are called, by the name of their sensor or part of it."""
    if part in SENSORS:
        return SENSORS[part].label
    return f"{SENSORS[AID_SOURCES[part].sensor].label}'s {AID_SOURCES[part].quantity}"


def _told(one: GivenSamples) -> str:
    why = one.refusals or "none arrives before the next of its kind"
    return f"the estimator is given {one.given} of {one.messages} samples of {_words(one.sensor)} ({why})"


def _count(one: GivenSamples) -> str:
    why = f" ({one.refusals})" if one.refused else ""
    return f"{one.given} of {one.messages} of {_words(one.sensor)}{why}"


CHECKS: tuple[Callable[[_Aids], Check], ...] = (
    magnetometer,
    mounting,
    barometer,
    gnss,
    gnss_fix,
    gnss_position_accuracy,
    gnss_height_accuracy,
    gnss_speed_accuracy,
    horizontal_aid,
    samples_given,
)
