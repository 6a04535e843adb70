"""A simulated flight from the mission to the log."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from fusetune.design.missions.mission import Mission
from fusetune.errors import UserError
from fusetune.execute.instances import second_imu, with_second_instance
from fusetune.execute.logger import ekf2_timestamps, logged_topics
from fusetune.execute.parameters import flown_parameters
from fusetune.execute.sensors.airspeed import airspeed_topics
from fusetune.execute.sensors.barometer import vehicle_air_data
from fusetune.execute.sensors.faults import DefaultProfile, Fault, InstanceWhipsaw, ToldWrong, of_kind
from fusetune.execute.sensors.gnss import vehicle_gps_position
from fusetune.execute.sensors.imu import inertial_topics
from fusetune.execute.sensors.magnetometer import vehicle_magnetometer
from fusetune.execute.sensors.optical_flow import vehicle_optical_flow
from fusetune.execute.sensors.power import actuator_motors, battery_status, vehicle_thrust_setpoint
from fusetune.execute.sensors.range_finder import distance_sensor
from fusetune.execute.sensors.stuck import stick
from fusetune.execute.sensors.vision import vehicle_visual_odometry
from fusetune.execute.vehicle import Vehicle
from fusetune.execute.world.flight_plan import FlightPlan, plan_flight
from fusetune.execute.world.groundtruth import groundtruth_topics
from fusetune.execute.world.truth import Truth, simulate_truth
from fusetune.execute.world.vehicle_state import sensor_selection, vehicle_land_detected, vehicle_status
from fusetune.px4.flight import Flight, LoggedMessage, ParameterHistory, TopicKey, TopicTable
from fusetune.px4.releases import BASELINE
from fusetune.px4.ulog.writer import write_ulog
from fusetune.px4.vehicle_identity import OWN_SIMULATOR

LONGEST_FLIGHT_S = 4500.0
RELEASE = BASELINE[0] << 24 | BASELINE[1] << 16 | 255
"""What the vehicle flies, as PX4 encodes it; the last byte marks a release."""


def simulate(
    mission: Mission,
    vehicle: Vehicle,
    parameters: Mapping[str, float],
    seed: int,
    faults: Sequence[Fault],
    path: str | os.PathLike[str],
) -> Flight:
    """Fly a mission and write the log.

    Parameters
    ----------
    mission, vehicle
        What is flown, and with what.
    parameters
        EKF2 parameters flown, beside those of the vehicle.
    seed
        Of all chance; the same seed gives the same bytes.
    faults
        What goes wrong, see `faults.parse_faults`.
    path
        The ULog that is written.

    Returns
    -------
    Flight
        What was written.

    Raises
    ------
    UserError
        The mission takes longer than `LONGEST_FLIGHT_S`.
    ParameterError
        A parameter is unknown, of the wrong type or out of range.
    """
    flight = fly(mission, vehicle, parameters, seed, faults, Path(path).stem)
    write_ulog(path, flight)
    return flight


def fly(
    mission: Mission,
    vehicle: Vehicle,
    parameters: Mapping[str, float],
    seed: int,
    faults: Sequence[Fault] = (),
    name: str = "",
    *,
    with_estimator: bool = True,
) -> Flight:
    """The flight that `simulate` writes; without the estimator its topics are left out."""
    default_profile = bool(of_kind(faults, DefaultProfile))
    told_wrong = {fault.parameter: fault.value for fault in of_kind(faults, ToldWrong)}
    flown = flown_parameters(vehicle, {**parameters, **told_wrong}, default_profile=default_profile)
    plan = plan_flight(mission, vehicle.limits)
    if plan.events.end_s > LONGEST_FLIGHT_S:
        raise UserError(
            f"mission {mission.name}",
            f"takes {plan.events.end_s / 60:.0f} minutes with vehicle {vehicle.name}",
            f"Keep simulated flights below {LONGEST_FLIGHT_S / 60:.0f} minutes",
        )
    truth = simulate_truth(plan, vehicle, seed)
    sensed = sensor_topics(truth, plan, mission, vehicle, faults, seed)
    each = [sensed]
    if of_kind(faults, InstanceWhipsaw):
        each.append(second_imu(sensed, truth, vehicle, faults, seed))
    estimated: list[dict[TopicKey, TopicTable]] = [{} for _ in each]
    if with_estimator:
        # Loads the compiled estimator, which the sensors do without.
        from fusetune.execute.onboard_estimator import estimator_topics

        estimated = [estimator_topics(_flight(name, mission, vehicle, plan, flown, one)) for one in each]
    flown_with = sensed | estimated[0] if len(each) == 1 else with_second_instance(each, estimated, truth, faults)
    everything = flown_with | groundtruth_topics(truth, mission.home.geoid_undulation_m)
    logged, dropouts = logged_topics(everything, plan.events, faults, seed)
    flight = _flight(name, mission, vehicle, plan, flown, logged)
    flight.dropouts = dropouts
    return flight


def sensor_topics(
    truth: Truth, plan: FlightPlan, mission: Mission, vehicle: Vehicle, faults: Sequence[Fault], seed: int
) -> dict[TopicKey, TopicTable]:
    """All that the sensors and the autopilot around the estimator tell, at full rate."""
    undulation_m = mission.home.geoid_undulation_m
    inertial = inertial_topics(truth, vehicle.imu, faults, seed)
    topics: dict[TopicKey, TopicTable] = {
        ("sensor_combined", 0): inertial.samples,
        ("vehicle_magnetometer", 0): vehicle_magnetometer(
            truth, vehicle.magnetometer, vehicle.environment, faults, seed
        ),
        ("vehicle_air_data", 0): vehicle_air_data(truth, vehicle.barometer, undulation_m, faults, seed),
        ("vehicle_gps_position", 0): vehicle_gps_position(
            truth, vehicle.gnss, vehicle.environment, undulation_m, faults, seed
        ),
        ("vehicle_land_detected", 0): vehicle_land_detected(plan, truth),
        ("vehicle_status", 0): vehicle_status(plan, truth),
        ("sensor_selection", 0): sensor_selection(truth),
        ("vehicle_imu_status", 0): inertial.status,
        ("actuator_motors", 0): actuator_motors(truth, vehicle.airframe),
    }
    topics["vehicle_thrust_setpoint", 0] = vehicle_thrust_setpoint(topics["actuator_motors", 0])
    if vehicle.range_finder is not None:
        topics["distance_sensor", 0] = distance_sensor(truth, vehicle.range_finder, faults, seed)
    if vehicle.optical_flow is not None:
        topics["vehicle_optical_flow", 0] = vehicle_optical_flow(truth, vehicle.optical_flow, faults, seed)
    if vehicle.vision is not None:
        topics["vehicle_visual_odometry", 0] = vehicle_visual_odometry(truth, vehicle.vision, faults, seed)
    if vehicle.airspeed is not None:
        for name, table in airspeed_topics(truth, vehicle.airspeed, undulation_m, faults, seed).items():
            topics[name, 0] = table
    if vehicle.battery is not None:
        topics["battery_status", 0] = battery_status(truth, vehicle.airframe, vehicle.battery, seed)
    stick(topics, truth.events.takeoff_s, faults)
    topics["ekf2_timestamps", 0] = ekf2_timestamps(topics)
    return topics


def _flight(
    name: str,
    mission: Mission,
    vehicle: Vehicle,
    plan: FlightPlan,
    parameters: ParameterHistory,
    topics: dict[TopicKey, TopicTable],
) -> Flight:
    imu_us = topics["sensor_combined", 0]["timestamp"]
    return Flight(
        name=name,
        topics=topics,
        parameters=parameters,
        info={
            "sys_name": "PX4",
            "sys_os_name": "fusetune",
            "ver_hw": OWN_SIMULATOR,
            "sys_uuid": vehicle.name,
            "ver_sw": "0" * 40,
            "ver_sw_release": RELEASE,
            "sys_mcu": vehicle.name,
            "time_ref_utc": 0,
        },
        messages=_messages(mission, vehicle, plan),
        start_timestamp=int(imu_us[0]),
        last_timestamp=max(int(table["timestamp"][-1]) for table in topics.values() if len(table["timestamp"])),
    )


def _messages(mission: Mission, vehicle: Vehicle, plan: FlightPlan) -> list[LoggedMessage]:
    events = plan.events
    texts = (
        (events.log_start_s + 0.01, f"[fusetune] simulated flight: mission {mission.name}, vehicle {vehicle.name}"),
        (events.armed_s, "[commander] Armed by mission"),
        (events.takeoff_s, "[commander] Takeoff detected"),
        (events.touchdown_s, "[commander] Landing detected"),
        (events.disarmed_s, "[commander] Disarmed by landing"),
    )
    return [LoggedMessage(round(time_s * 1e6), "INFO", text) for time_s, text in texts]
