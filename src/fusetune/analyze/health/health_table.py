"""The health table of a flight: all figures of sensors and filter, each with its limit."""

from __future__ import annotations

from collections.abc import Iterator

from fusetune.analyze.health.aid_source_rows import aid_source_rows
from fusetune.analyze.health.aiding_rows import aiding_rows
from fusetune.analyze.health.bias_rows import bias_rows
from fusetune.analyze.health.filter_rows import alignment_rows, fault_row, flight_rows, output_rows, time_slip_row
from fusetune.analyze.health.gnss_rows import check_row, gnss_rows
from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.imu_rows import clipping_rows, vibration_rows
from fusetune.analyze.health.instance_rows import instance_rows
from fusetune.analyze.health.instance_samples import instance_samples
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.receiver_rows import receiver_rows
from fusetune.analyze.health.replay_rows import replay_rows
from fusetune.analyze.health.reset_rows import local_position_rows, reset_rows
from fusetune.analyze.health.sensor_rows import aid_sensor_rows, imu_rows
from fusetune.analyze.health.settings import HealthSettings
from fusetune.analyze.health.status_rows import rejection_rows, status_ratio_rows
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.analyze.replaying.onboard import INNOVATION_TOPICS
from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS
from fusetune.px4.aid_sources import SENSOR_TOPICS
from fusetune.px4.layouts.bias_states import bias_states
from fusetune.px4.layouts.logged_state import LOGGED_STATE_TOPICS

DEFAULTS = HealthSettings()

HEALTH_TOPICS = (
    *dict.fromkeys(
        (
            *REPLAY_TOPICS,
            *INNOVATION_TOPICS,
            *LOGGED_STATE_TOPICS,
            *(name for topic in SENSOR_TOPICS.values() for name in (topic.name, *topic.made_of)),
            "estimator_event_flags",
            "estimator_gps_status",
            "sensor_gps",
            "vehicle_imu",
            "vehicle_imu_status",
            "vehicle_status",
        )
    ),
)
"""What the table reads of a saved flight."""


def health_rows(observed: ObservedFlight, settings: HealthSettings = DEFAULTS) -> tuple[HealthRow, ...]:
    """All rows of a flight of any release, of each estimator instance.

    What the log lacks of the vehicle's own estimator is told from the replay, with that origin; what neither has does
    not apply. The flight is replayed only where its log lacks innovations, flags or states.
    """
    health = JudgedHealth(observed, settings)
    return tuple(_rows(health))


def _rows(health: JudgedHealth) -> Iterator[HealthRow]:
    yield from flight_rows(health)
    yield from instance_rows(health)
    for instance in health.instances:
        yield from _rows_of_instance(health, instance)
    yield from replay_rows(health)
    yield from local_position_rows(health)
    yield from vibration_rows(health)
    yield from clipping_rows(health)
    yield from gnss_rows(health)
    yield from receiver_rows(health)
    yield from imu_rows(health)
    yield from aid_sensor_rows(health)


def _rows_of_instance(health: JudgedHealth, instance: int) -> Iterator[HealthRow]:
    samples, flags = instance_samples(health.flight, instance), health.topic("estimator_status_flags", instance)
    if samples:
        yield from aid_source_rows(health, samples, instance, "vehicle")
        yield from aiding_rows(health, samples, flags, instance, "vehicle")
    most = max((samples[key].timestamp_sample.size for key in samples), default=0)
    yield from status_ratio_rows(health, instance, judged=most < health.limits.fewest_samples)
    yield from rejection_rows(health, instance)
    if flags is not None:
        yield fault_row(health, flags, instance)
        yield from alignment_rows(health, flags, instance)
    yield from reset_rows(health, instance)
    yield time_slip_row(health, instance)
    yield from output_rows(health, instance)
    if health.topic("estimator_states", instance) is not None:
        yield from bias_rows(health, bias_states(health.flight, instance), instance)
    yield check_row(health, instance)
