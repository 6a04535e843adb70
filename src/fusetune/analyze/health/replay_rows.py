"""What the log lacks of the vehicle's own estimator, from the replay of its flight."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fusetune.analyze.health.aid_source_rows import aid_source_rows
from fusetune.analyze.health.aiding_rows import aiding_rows
from fusetune.analyze.health.bias_rows import bias_rows
from fusetune.analyze.health.filter_rows import alignment_rows, fault_row
from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.instance_samples import instance_samples
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.reset_rows import rows_of_resets
from fusetune.analyze.health.subject import Subject
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.px4.layouts.bias_states import BiasStates
from fusetune.save.thresholds import VerdictThresholds

_IMU = ("gyro_rad[2]", "accelerometer_m_s2[2]", "gyro_integral_dt", "accelerometer_integral_dt")
_LIMITS = VerdictThresholds()


def replay_rows(health: JudgedHealth) -> Iterator[HealthRow]:
    """Rows of the parts of the estimator of which no instance logged anything."""
    lacks_samples = not any(len(instance_samples(health.flight, one)) for one in health.instances)
    lacks_flags = not any(health.topic("estimator_status_flags", one) is not None for one in health.instances)
    lacks_states = not any(health.topic("estimator_states", one) is not None for one in health.instances)
    if not (lacks_samples or lacks_flags or lacks_states):
        return
    subject = Subject("replay", "what the log lacks of the filter", "filter", None, "replay")
    if not health.airborne:
        yield subject.lacking("status", "nothing flew, so nothing is replayed for it")
        return
    why_not = _why_not(health)
    if why_not:
        yield subject.lacking("status", why_not)
        return
    replayed = health.observed.replayed
    if replayed.status != "ok":
        yield subject.lacking("status", f"the replay is {replayed.status}")
    flags = replayed.flags if "timestamp" in replayed.flags and len(replayed.flags["timestamp"]) else None
    instance = health.primary
    if lacks_samples:
        yield from aid_source_rows(health, replayed.samples, instance, "replay")
        yield from aiding_rows(health, replayed.samples, flags, instance, "replay")
    if lacks_flags:
        yield fault_row(health, flags, instance, "replay")
        yield from alignment_rows(health, flags, instance, "replay")
        yield from rows_of_resets(health, replayed.reset_times, instance, "replay")
    if lacks_states:
        yield from bias_rows(health, _biases(replayed), instance, "replay")


def _why_not(health: JudgedHealth) -> str:
    """Why a flight cannot be replayed at all; empty where it can be tried."""
    imu = health.topic("sensor_combined")
    if imu is None or any(name not in imu for name in _IMU):
        return "the log has no IMU samples, so there is no replay either"
    steps = np.diff(imu["timestamp"])
    steps = steps[steps > 0]
    if steps.sum() * 1e-6 < _LIMITS.min_imu_duration_s or 1e6 / np.median(steps) < _LIMITS.min_imu_rate_hz:
        return "the log has too few IMU samples, so there is no replay either"
    return ""


def _biases(replayed: ReplayedSet) -> BiasStates | None:
    if replayed.steps is None:
        return None
    steps = replayed.steps()
    return BiasStates(steps.time, steps.gyro_bias, steps.accel_bias, 1.0) if steps.time.size else None
