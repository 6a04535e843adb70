"""A log of any release in the layout of v1.16: topics and fields mapped by name.

Here topics take another's place; what each one had otherwise, and until which release, say its function in
`sensor_layouts`, for the estimator's own topics `estimator_layouts`, `state_layout` and `onboard_innovations`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fusetune.px4.aid_sources import SENSOR_TOPICS
from fusetune.px4.flight import Flight, TopicKey, TopicTable
from fusetune.px4.layouts import sensor_layouts as layouts
from fusetune.px4.layouts.estimator_instances import magnetometer_instance, primary_imu, primary_magnetometer
from fusetune.px4.layouts.estimator_layouts import estimator_tables
from fusetune.px4.layouts.onboard_innovations import aid_source_tables
from fusetune.px4.parameters.logged_parameters import checked_history
from fusetune.px4.sensor_limits import without_impossible

_FIX_3D = 3

ESTIMATOR_TOPICS = (
    "sensor_combined",
    *(name for topic in SENSOR_TOPICS.values() for name in (topic.name, *topic.made_of)),
    "vehicle_status",
    "vehicle_land_detected",
    "launch_detection_status",
    "vehicle_command",
    "sensor_selection",
    "ekf2_timestamps",
    "estimator_selector_status",
    "estimator_status",
)
"""Topics of any release that the canonical inputs of the estimator are made from."""


def canonical(flight: Flight) -> Flight:
    """The flight with every topic that the estimator and the metrics read in the layout of v1.16.

    Other topics, and columns that v1.16 does not have, stay as they are; the flight given is not changed. Of several
    IMUs and magnetometers, instance 0 becomes, of each time, the one that the estimator instance used that was primary
    then (see `estimator_instances`); of several GNSS receivers (before v1.12) the first that ever has a 3D
    fix. A flight has no other form than this one; `of_one_instance` gives the flight of one estimator instance to it.
    `estimator_aid_src_*`, `estimator_status_flags` and `estimator_states` are made from the topics that came before
    them (see `onboard_innovations` and `estimator_layouts`). Samples that cannot be, see
    `fusetune.px4.sensor_limits`, are left out and counted in `Flight.left_out`; parameters that cannot be, see
    `fusetune.px4.parameters.logged_parameters`, are replaced and listed in `Flight.replaced_parameters`.
    """
    topics = dict(flight.topics)
    for (name, instance), table in flight.topics.items():
        if name in layouts.CONVERTERS:
            topics[name, instance] = layouts.CONVERTERS[name](table)
    topics |= _from_sensor_combined(flight)
    topics |= _under_other_names(flight)
    topics |= _vision(flight)
    topics, left_out = without_impossible(topics)
    parameters, replaced = checked_history(flight.parameters, flight.release)
    sound = replace(
        flight,
        topics=topics,
        parameters=parameters,
        left_out=(*flight.left_out, *left_out),
        replaced_parameters=(*flight.replaced_parameters, *replaced),
    )
    topics = dict(topics)
    _put_first(topics, "vehicle_magnetometer", magnetometer_instance(sound))
    _follow_primary(sound, topics)
    _put_first(topics, "vehicle_gps_position", _gnss_instance(sound))
    topics |= estimator_tables(sound)
    topics |= aid_source_tables(sound)
    return sound.with_topics(topics)


def _follow_primary(flight: Flight, topics: dict[TopicKey, TopicTable]) -> None:
    for name, table in (
        ("sensor_combined", primary_imu(flight)),
        ("vehicle_magnetometer", primary_magnetometer(flight)),
    ):
        if table is not None:
            topics[name, 0] = layouts.CONVERTERS[name](table)


def _put_first(topics: dict[TopicKey, TopicTable], name: str, instance: int) -> None:
    if (name, instance) in topics:
        topics[name, 0] = topics[name, instance]


def _from_sensor_combined(flight: Flight) -> dict[TopicKey, TopicTable]:
    """Magnetometer and barometer of releases that logged them with the IMU (v1.5 to v1.7)."""
    combined = flight.topic("sensor_combined")
    tables: dict[TopicKey, TopicTable] = {}
    if combined is None:
        return tables
    magnetometer = layouts.magnetometer_of_sensor_combined(combined)
    if magnetometer is not None and not flight.has("vehicle_magnetometer"):
        tables["vehicle_magnetometer", 0] = magnetometer
    barometer = layouts.barometer_of_sensor_combined(combined)
    if barometer is not None and not flight.has("vehicle_air_data"):
        tables["vehicle_air_data", 0] = barometer
    return tables


def _under_other_names(flight: Flight) -> dict[TopicKey, TopicTable]:
    """Sensor topics that are one topic of the log, under another name."""
    return {
        (topic.name, instance): layouts.CONVERTERS[topic.name](flight.topics[topic.made_of[0], instance])
        for topic in SENSOR_TOPICS.values()
        if len(topic.made_of) == 1 and not flight.has(topic.name)
        for instance in flight.instances(topic.made_of[0])
    }


def _vision(flight: Flight) -> dict[TopicKey, TopicTable]:
    position = flight.topic("vehicle_vision_position")
    if flight.has("vehicle_visual_odometry") or position is None:
        return {}
    attitude = flight.topic("vehicle_vision_attitude")
    return {("vehicle_visual_odometry", 0): layouts.visual_odometry_of_vision_topics(position, attitude)}


def _gnss_instance(flight: Flight) -> int:
    instances = flight.instances("vehicle_gps_position")
    for instance in instances:
        if np.any(flight.topics["vehicle_gps_position", instance].get("fix_type", np.zeros(1)) >= _FIX_3D):
            return instance
    return instances[0] if instances else 0
