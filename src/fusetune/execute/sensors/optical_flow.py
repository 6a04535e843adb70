"""Optical flow (`vehicle_optical_flow`): how the ground turns about the sensor, with the turn of the sensor itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.execute.noise import random_stream
from fusetune.execute.sensors.faults import Fault, FlowRotation, FlowScale, of_kind
from fusetune.execute.sensors.mounted import distance_to_ground, velocity_of
from fusetune.execute.sensors.sampling import sample_times
from fusetune.execute.vehicle import OpticalFlow
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable

DEVICE_ID = 9699585
QUALITY_DEVIATION = 6.0
LEAST_DISTANCE_M = 0.08
PUBLISHED_AFTER_US = 400


def vehicle_optical_flow(truth: Truth, sensor: OpticalFlow, faults: Sequence[Fault], seed: int) -> TopicTable:
    """Flow samples in the layout of PX4's topic.

    With u the velocity of the sensor in the body frame, d the distance to the ground along its axis and ω the body's
    rate, the image turns by ω_x - u_y / d about the forward axis and by ω_y + u_x / d about the right one; the motion
    in the middle of the integration stands for all of it. Beyond its reach the sensor says so by a quality of 0.
    """
    rng = random_stream(seed, "optical flow")
    end_us = sample_times(truth, sensor.rate_hz, rng)
    timespan_us = round(1e6 / sensor.rate_hz)
    middle_us = end_us - timespan_us // 2
    dt = timespan_us * 1e-6
    samples = len(end_us)
    rate = truth.body_rate_at(middle_us)
    velocity = velocity_of(truth, middle_us, sensor.position_m)
    through = truth.attitude_at(middle_us).inv().apply(velocity)
    distance, _ = distance_to_ground(truth, middle_us, sensor.position_m, sensor.ground_distance_m)
    reach = np.maximum(distance, LEAST_DISTANCE_M)[:, None]
    flow = rate[:, :2] + np.column_stack([-through[:, 1], through[:, 0]]) / reach
    flow = flow + sensor.noise_rad_s * rng.standard_normal((samples, 2))
    gyro = rate + sensor.gyro_noise_rad_s * rng.standard_normal((samples, 3))
    quality = sensor.quality + QUALITY_DEVIATION * rng.standard_normal(samples)
    flow, gyro = _as_mounted(flow, gyro, faults)
    lost = (distance > sensor.maximum_distance_m) | (np.abs(flow) > sensor.maximum_rate_rad_s).any(axis=1)
    sample_us = end_us + round(sensor.delay_ms * 1e3)
    pixels, turned = (flow * dt).astype(np.float32), (gyro * dt).astype(np.float32)
    return {
        "timestamp": (sample_us + PUBLISHED_AFTER_US).astype(np.int64),
        "timestamp_sample": sample_us.astype(np.int64),
        "device_id": np.full(samples, DEVICE_ID, np.uint32),
        **{f"pixel_flow[{axis}]": pixels[:, axis] for axis in range(2)},
        **{f"delta_angle[{axis}]": turned[:, axis] for axis in range(3)},
        "distance_m": np.full(samples, np.nan, np.float32),
        "integration_timespan_us": np.full(samples, timespan_us, np.uint32),
        "quality": np.where(lost, 0, np.clip(np.rint(quality), 0, 255)).astype(np.uint8),
        "max_flow_rate": np.full(samples, sensor.maximum_rate_rad_s, np.float32),
        "min_ground_distance": np.full(samples, LEAST_DISTANCE_M, np.float32),
        "max_ground_distance": np.full(samples, sensor.maximum_distance_m, np.float32),
    }


def _as_mounted(flow: np.ndarray, gyro: np.ndarray, faults: Sequence[Fault]) -> tuple[np.ndarray, np.ndarray]:
    """Flow (N, 2) and gyro (N, 3) of a sensor that is scaled or turned otherwise than PX4 is told."""
    for scaled in of_kind(faults, FlowScale):
        flow = flow * scaled.factor
    for turned in of_kind(faults, FlowRotation):
        angle = np.radians(turned.turned_deg)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        flow = flow @ turn.T
        gyro = gyro * turned.gyro_share
    return flow, gyro
