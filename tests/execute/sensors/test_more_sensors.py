"""Range finder, optical flow, vision, airspeed and battery: on the truth, with the errors and faults configured."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from fusetune.execute.sensors.airspeed import airspeed_topics
from fusetune.execute.sensors.faults import (
    AirspeedScale,
    FlowRotation,
    FlowScale,
    RangeObstruction,
    RangeStep,
    VisionCovariance,
    VisionScale,
    VisionYaw,
)
from fusetune.execute.sensors.optical_flow import vehicle_optical_flow
from fusetune.execute.sensors.power import actuator_motors, battery_status, vehicle_thrust_setpoint
from fusetune.execute.sensors.range_finder import distance_sensor
from fusetune.execute.sensors.vision import vehicle_visual_odometry
from fusetune.execute.vehicle import AirspeedSensor, Battery, OpticalFlow, RangeFinder, Vehicle, Vision
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable, stacked

SEED = 7
UNDULATION_M = 47.4
EXACT_RANGE = RangeFinder(20.0, 0.0, 0.0, 0.1, 30.0, (0.0, 0.0, 0.0), 0.2, 5.0)
EXACT_FLOW = OpticalFlow(50.0, 0.0, 0.0, 220, 7.4, 30.0, (0.0, 0.0, 0.0), 0.2, 20.0)
EXACT_VISION = Vision(30.0, 0.0, 0.0, 60.0, 0.0, 0.0, 0.1, 0.2, 2.0, (0.0, 0.0, 0.0), 40.0)
EXACT_AIRSPEED = AirspeedSensor(10.0, 0.0, 0.0, 60.0)


def in_flight(truth: Truth, table: TopicTable) -> np.ndarray:
    """Rows well away from the ground."""
    time_s = table["timestamp"] * 1e-6
    return (time_s > truth.events.takeoff_s + 6.0) & (time_s < truth.events.touchdown_s - 6.0)


def tilt(truth: Truth, at_us: np.ndarray) -> np.ndarray:
    """Cosine of the tilt, by the quaternion's formula 1 - 2 (x² + y²)."""
    x, y, _, _ = truth.attitude_at(at_us).as_quat().T
    return np.asarray(1.0 - 2.0 * (x**2 + y**2))


def test_range_is_height_over_the_cosine_of_the_tilt(truth: Truth) -> None:
    table = distance_sensor(truth, EXACT_RANGE, (), SEED)
    measured_us = table["timestamp"] - 5_000
    height = 0.2 - truth.at(measured_us, truth.position)[:, 2]
    flying = in_flight(truth, table)
    assert table["current_distance"][flying] == pytest.approx((height / tilt(truth, measured_us))[flying], abs=1e-4)
    # it stands on legs of 0.2 m, tilted by about a degree
    standing = table["timestamp"] * 1e-6 < truth.events.armed_s
    assert table["current_distance"][standing] == pytest.approx(0.2, abs=1e-3)
    assert (table["orientation"] == 25).all()
    assert (table["signal_quality"] == 100).all()


def test_range_finder_off_the_imu_is_higher_or_lower_with_the_attitude(truth: Truth) -> None:
    table = distance_sensor(truth, dataclasses.replace(EXACT_RANGE, position_m=(1.0, 0.0, 0.5)), (), SEED)
    centred = distance_sensor(truth, EXACT_RANGE, (), SEED)
    measured_us = table["timestamp"] - 5_000
    # forward axis in the tangent frame: its down component is 2 (x z - w y)
    x, y, z, w = truth.attitude_at(measured_us).as_quat().T
    down = 2.0 * (x * z - w * y)
    cos = tilt(truth, measured_us)
    flying = in_flight(truth, table)
    # what 0.5 m down takes from the distance its mark on the ground, 0.5 m lower, gives back
    expected = centred["current_distance"] - (down * 1.0 + 0.5 * cos - 0.5) / cos
    assert table["current_distance"][flying] == pytest.approx(expected[flying], abs=1e-4)


def test_beyond_its_reach_a_range_finder_has_no_echo(truth: Truth) -> None:
    table = distance_sensor(truth, dataclasses.replace(EXACT_RANGE, maximum_m=4.0), (), SEED)
    flying = in_flight(truth, table)
    assert (table["signal_quality"][flying] == 0).any()
    assert table["current_distance"].max() == pytest.approx(4.0)


def test_range_noise_grows_with_the_distance(truth: Truth) -> None:
    noisy = dataclasses.replace(EXACT_RANGE, rate_hz=100.0, noise_m=0.03, noise_share=0.01)
    exact = distance_sensor(truth, dataclasses.replace(EXACT_RANGE, rate_hz=100.0), (), SEED)
    error = distance_sensor(truth, noisy, (), SEED)["current_distance"] - exact["current_distance"]
    scale = np.hypot(0.03, 0.01 * exact["current_distance"])
    # the standard deviation of 5000 draws is known to 1 %
    assert np.std(error / scale) == pytest.approx(1.0, rel=0.05)


def test_obstruction_and_step_change_the_range_while_they_last(truth: Truth) -> None:
    plain = distance_sensor(truth, EXACT_RANGE, (), SEED)
    after_s = plain["timestamp"] * 1e-6 - 0.005 - truth.events.takeoff_s
    blocked = distance_sensor(truth, EXACT_RANGE, (RangeObstruction(8.0, 3.0, 0.4),), SEED)
    on = (after_s >= 8.0) & (after_s < 11.0)
    assert blocked["current_distance"][on] == pytest.approx(0.4)
    assert np.array_equal(blocked["current_distance"][~on], plain["current_distance"][~on])
    stepped = distance_sensor(truth, EXACT_RANGE, (RangeStep(8.0, 3.0, 0.75),), SEED)
    shorter = (plain["current_distance"] - stepped["current_distance"]) * tilt(truth, plain["timestamp"] - 5_000)
    assert shorter[on] == pytest.approx(0.75, abs=1e-3)
    assert shorter[~on] == pytest.approx(0.0)
    some = distance_sensor(truth, EXACT_RANGE, (RangeObstruction(0.0, 20.0, 0.4, share=0.3),), SEED)
    hit = (some["current_distance"] == np.float32(0.4))[(after_s >= 0.0) & (after_s < 20.0)]
    # 400 draws: a standard error of 0.023
    assert hit.mean() == pytest.approx(0.3, abs=0.08)


def test_flow_is_the_turn_of_the_ground_and_of_the_vehicle(truth: Truth) -> None:
    table = vehicle_optical_flow(truth, EXACT_FLOW, (), SEED)
    middle_us = table["timestamp_sample"] - 20_000 - 10_000
    flying = in_flight(truth, table)
    body = truth.attitude_at(middle_us).inv().apply(truth.at(middle_us, truth.velocity))
    distance = (0.2 - truth.at(middle_us, truth.position)[:, 2]) / tilt(truth, middle_us)
    gyro, flow = stacked(table, "delta_angle") / 0.02, stacked(table, "pixel_flow") / 0.02
    assert gyro[flying] == pytest.approx(truth.body_rate_at(middle_us)[flying], abs=1e-5)
    assert (flow[:, 0] - gyro[:, 0])[flying] == pytest.approx((-body[:, 1] / distance)[flying], abs=1e-4)
    assert (flow[:, 1] - gyro[:, 1])[flying] == pytest.approx((body[:, 0] / distance)[flying], abs=1e-4)
    assert (table["integration_timespan_us"] == 20_000).all()


def test_scaled_and_turned_flow(truth: Truth) -> None:
    plain = stacked(vehicle_optical_flow(truth, EXACT_FLOW, (), SEED), "pixel_flow")
    scaled = stacked(vehicle_optical_flow(truth, EXACT_FLOW, (FlowScale(1.25),), SEED), "pixel_flow")
    assert scaled == pytest.approx(1.25 * plain, rel=1e-6)
    turned = vehicle_optical_flow(truth, EXACT_FLOW, (FlowRotation(turned_deg=90.0, gyro_share=0.0),), SEED)
    # turned clockwise by a quarter: what was forward is now left, minus the right axis
    assert turned["pixel_flow[0]"] == pytest.approx(plain[:, 1], abs=1e-7)
    assert turned["pixel_flow[1]"] == pytest.approx(-plain[:, 0], abs=1e-7)
    assert not stacked(turned, "delta_angle").any()


def test_flow_that_is_too_fast_has_no_quality(truth: Truth) -> None:
    slow = dataclasses.replace(EXACT_FLOW, maximum_rate_rad_s=0.3)
    table = vehicle_optical_flow(truth, slow, (), SEED)
    fast = (np.abs(stacked(table, "pixel_flow") / 0.02) > 0.3001).any(axis=1)
    assert fast.any()
    assert (table["quality"][fast] == 0).all()


def test_vision_is_the_truth_of_the_moment_of_the_picture(truth: Truth) -> None:
    table = vehicle_visual_odometry(truth, EXACT_VISION, (), SEED)
    picture_us = table["timestamp_sample"] - 40_000
    assert stacked(table, "position") == pytest.approx(truth.at(picture_us, truth.position), abs=1e-5)
    assert stacked(table, "velocity") == pytest.approx(truth.at(picture_us, truth.velocity), abs=1e-5)
    quaternion = stacked(table, "q")
    assert np.linalg.norm(quaternion, axis=1) == pytest.approx(1.0, abs=1e-6)
    true = truth.attitude_at(picture_us).as_quat(scalar_first=True)
    assert np.abs(np.sum(quaternion * true, axis=1)) == pytest.approx(1.0, abs=1e-6)
    assert table["position_variance[0]"] == pytest.approx(0.01)
    assert table["orientation_variance[2]"] == pytest.approx(math.radians(2.0) ** 2)


def test_turned_scaled_and_overconfident_vision(truth: Truth) -> None:
    plain = stacked(vehicle_visual_odometry(truth, EXACT_VISION, (), SEED), "position").astype(float)
    turned = stacked(vehicle_visual_odometry(truth, EXACT_VISION, (VisionYaw(90.0),), SEED), "position")
    # a frame turned by a quarter calls what is north east
    assert turned == pytest.approx(np.column_stack([-plain[:, 1], plain[:, 0], plain[:, 2]]), abs=1e-5)
    scaled = vehicle_visual_odometry(truth, EXACT_VISION, (VisionScale(0.8),), SEED)
    assert stacked(scaled, "position") == pytest.approx(0.8 * plain, abs=1e-5)
    noisy = dataclasses.replace(EXACT_VISION, position_noise_m=0.05)
    worse = vehicle_visual_odometry(truth, noisy, (VisionCovariance(error_factor=6.0, claimed_factor=0.5),), SEED)
    assert (stacked(worse, "position") - plain).std() == pytest.approx(0.3, rel=0.05)
    assert worse["position_variance[1]"] == pytest.approx((0.5 * 0.1) ** 2)


def test_airspeed_is_the_forward_speed_through_the_air(truth: Truth) -> None:
    tables = airspeed_topics(truth, EXACT_AIRSPEED, UNDULATION_M, (), SEED)
    table = tables["airspeed"]
    at_us = table["timestamp_sample"] - 60_000
    through_air = truth.at(at_us, truth.velocity - truth.wind)
    forward = truth.attitude_at(at_us).inv().apply(through_air)[:, 0]
    assert table["true_airspeed_m_s"] == pytest.approx(forward, abs=1e-4)
    # ISO 2533 at 490 m: 1.168 kg/m³, so indicated over true is sqrt(1.168 / 1.225)
    ratio = table["indicated_airspeed_m_s"] / table["true_airspeed_m_s"]
    assert ratio[np.abs(forward) > 1.0] == pytest.approx(math.sqrt(1.168 / 1.225), rel=1e-3)
    assert np.array_equal(tables["airspeed_validated"]["true_airspeed_m_s"], table["true_airspeed_m_s"])
    scaled = airspeed_topics(truth, EXACT_AIRSPEED, UNDULATION_M, (AirspeedScale(1.2),), SEED)["airspeed"]
    assert scaled["true_airspeed_m_s"] == pytest.approx(1.2 * table["true_airspeed_m_s"], rel=1e-5)


def test_throttle_and_current_follow_the_square_of_the_rotor_speed(truth: Truth, vehicle: Vehicle) -> None:
    motors = actuator_motors(truth, vehicle.airframe)
    speed = truth.at(motors["timestamp"], truth.rotor_speed)
    assert motors["control[0]"] == pytest.approx(0.42 * speed**2, abs=1e-6)
    assert np.isnan(motors["control[4]"]).all()
    assert np.array_equal(vehicle_thrust_setpoint(motors)["xyz[2]"], -motors["control[0]"])
    battery = battery_status(truth, vehicle.airframe, Battery(4, 15.0, 0.5, 0.02, 0.0), SEED)
    thrust = truth.at(battery["timestamp"], truth.rotor_speed) ** 2
    # between two instants of the truth the speed is interpolated, not its square
    assert battery["current_a"] == pytest.approx(0.5 + 15.0 * thrust, rel=1e-3)
    assert battery["voltage_v"] == pytest.approx(4 * 4.15 - 0.02 * (0.5 + 15.0 * thrust), rel=1e-3)
