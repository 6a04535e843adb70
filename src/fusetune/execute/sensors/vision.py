"""External vision (`vehicle_visual_odometry`): where a camera is, how fast it moves, and how it is turned."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from fusetune.execute.noise import gauss_markov, random_stream
from fusetune.execute.sensors.faults import Fault, VisionCovariance, VisionScale, VisionYaw, of_kind
from fusetune.execute.sensors.mounted import place_of, velocity_of
from fusetune.execute.sensors.sampling import sample_times
from fusetune.execute.vehicle import Vision
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable

FRAME_NED = 1
GOOD_QUALITY = 90
PUBLISHED_AFTER_US = 600


def vehicle_visual_odometry(truth: Truth, vision: Vision, faults: Sequence[Fault], seed: int) -> TopicTable:
    """Vision samples in the layout of PX4's topic, in north, east, down from home.

    `timestamp_sample` is later than the picture by the delay: whoever sends it does not share PX4's clock.
    """
    rng = random_stream(seed, "vision")
    picture_us = sample_times(truth, vision.rate_hz, rng)
    samples = len(picture_us)
    errs, claims, scale, turn = 1.0, 1.0, 1.0, 0.0
    for covariance in of_kind(faults, VisionCovariance):
        errs, claims = errs * covariance.error_factor, claims * covariance.claimed_factor
    for scaled in of_kind(faults, VisionScale):
        scale *= scaled.factor
    for turned in of_kind(faults, VisionYaw):
        turn += math.radians(turned.turned_deg)
    frame = Rotation.from_euler("Z", turn)
    wander = gauss_markov(
        rng, samples, 3, 1.0 / vision.rate_hz, errs * vision.position_wander_m, vision.position_wander_time_s
    )
    position = frame.apply(scale * place_of(truth, picture_us, vision.position_m)) + wander
    position = position + errs * vision.position_noise_m * rng.standard_normal((samples, 3))
    velocity = frame.apply(scale * velocity_of(truth, picture_us, vision.position_m))
    velocity = velocity + errs * vision.velocity_noise_m_s * rng.standard_normal((samples, 3))
    noise = errs * math.radians(vision.attitude_noise_deg) * rng.standard_normal((samples, 3))
    attitude = Rotation.from_rotvec(noise) * frame * truth.attitude_at(picture_us)
    quaternion = attitude.as_quat(canonical=True, scalar_first=True)
    sample_us = picture_us + round(vision.delay_ms * 1e3)
    nan = np.full(samples, np.nan, np.float32)
    table: TopicTable = {
        "timestamp": (sample_us + PUBLISHED_AFTER_US).astype(np.int64),
        "timestamp_sample": sample_us.astype(np.int64),
    }
    for name, values in (("position", position), ("q", quaternion), ("velocity", velocity)):
        table |= {f"{name}[{axis}]": values[:, axis].astype(np.float32) for axis in range(values.shape[1])}
    table |= {f"angular_velocity[{axis}]": nan.copy() for axis in range(3)}
    for name, deviation in (
        ("position", vision.claimed_position_m),
        ("orientation", math.radians(vision.claimed_attitude_deg)),
        ("velocity", vision.claimed_velocity_m_s),
    ):
        variance = np.float32((claims * deviation) ** 2)
        table |= {f"{name}_variance[{axis}]": np.full(samples, variance) for axis in range(3)}
    return table | {
        "pose_frame": np.full(samples, FRAME_NED, np.uint8),
        "velocity_frame": np.full(samples, FRAME_NED, np.uint8),
        "reset_counter": np.zeros(samples, np.uint8),
        "quality": np.full(samples, GOOD_QUALITY, np.int8),
    }
