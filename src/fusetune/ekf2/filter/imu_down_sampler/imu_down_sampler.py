"""Collect IMU samples into one per estimator interval (EKF2_PREDICT_US).

Rotation is accumulated as a quaternion and velocity is carried along in the rotating body frame, so that coning and
sculling survive the lower rate. The number of samples per interval follows from the mean gyro interval. All times
are single precision as in PX4: they decide when a sample is complete and, through the mean interval, the time
stamps of aiding samples to the microsecond.

Mirrors PX4 v1.16 `EKF/imu_down_sampler/imu_down_sampler.cpp`.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sensor_samples import IMU_SAMPLE
from fusetune.ekf2.numerics.rotations import quat_to_rotation_vector, rotate_by_body_increment, rotation_vector_to_quat

DOWN_SAMPLER_MEMORY = np.dtype(
    [
        ("sample", IMU_SAMPLE),
        ("rotation", "f8", (4,)),
        ("mean_dt", "f4"),
        ("target_dt", "f4"),
        ("min_dt", "f4"),
        ("count", "i8"),
        ("required", "i8"),
    ],
    align=True,
)
"""The estimator's sub-record `ekf.down_sampler`."""

INITIAL_MEAN_DT = np.float32(0.005)
FIRST_INTERVAL_US = 10_000.0
"""PX4 makes its down-sampler before it binds parameters: the first interval has EKF2_PREDICT_US's default length."""


@kernel
def initialise_down_sampler(sampler):
    """Start with PX4's guess of the gyro interval, and an interval of the default length."""
    sampler.mean_dt = INITIAL_MEAN_DT
    reset_down_sampler(sampler, FIRST_INTERVAL_US)


@kernel
def reset_down_sampler(sampler, length_us):
    """Start the next interval, of EKF2_PREDICT_US.

    The sum is emptied; the number of samples that fill it follows from the mean gyro interval seen so far.
    """
    sample = sampler.sample
    sample.time_us = 0
    sample.delta_ang[:] = 0.0
    sample.delta_vel[:] = 0.0
    sample.delta_ang_dt = 0.0
    sample.delta_vel_dt = 0.0
    sample.delta_vel_clipping[:] = 0
    sampler.rotation[0] = 1.0
    sampler.rotation[1:] = 0.0
    sampler.count = 0
    target = np.float32(min(max(length_us, 1000.0), 100_000.0)) * np.float32(1e-6)
    mean_dt = sampler.mean_dt
    sampler.required = max(int(np.floor(target / mean_dt + np.float32(0.5))), 1)
    sampler.target_dt = np.float32(sampler.required) * mean_dt
    sampler.min_dt = max(mean_dt * (np.float32(sampler.required) - np.float32(1.0)), mean_dt * np.float32(0.5))


@kernel
def accumulate_imu(sampler, imu):
    """Add one IMU sample, IMU_ROW or IMU_SAMPLE; returns whether `sampler.sample` is complete."""
    sample = sampler.sample
    sampler.mean_dt = np.float32(0.9) * sampler.mean_dt + np.float32(0.1) * np.float32(imu.delta_ang_dt)
    sample.time_us = imu.time_us
    sample.delta_ang_dt = np.float32(sample.delta_ang_dt) + np.float32(imu.delta_ang_dt)
    sample.delta_vel_dt = np.float32(sample.delta_vel_dt) + np.float32(imu.delta_vel_dt)
    x, y, z = np.float64(imu.delta_ang[0]), np.float64(imu.delta_ang[1]), np.float64(imu.delta_ang[2])
    _carry_velocity(sample.delta_vel, imu.delta_vel, rotation_vector_to_quat(x, y, z))
    rotate_by_body_increment(sampler.rotation, x, y, z)
    for axis in range(3):
        sample.delta_vel_clipping[axis] |= imu.delta_vel_clipping[axis]
    sampler.count += 1
    enough_samples = sampler.count >= sampler.required and np.float32(sample.delta_ang_dt) > sampler.min_dt
    if enough_samples or np.float32(sample.delta_ang_dt) > sampler.target_dt:
        x, y, z = quat_to_rotation_vector(sampler.rotation)
        sample.delta_ang[0], sample.delta_ang[1], sample.delta_ang[2] = x, y, z
        return True
    return False


@kernel
def _carry_velocity(accumulated, delta_vel, q):
    """Turn the accumulated velocity into the frame after rotation `q` and add the new increment at mid-rotation."""
    a0, a1, a2 = _rotate_inverse(q, accumulated[0], accumulated[1], accumulated[2])
    x, y, z = np.float64(delta_vel[0]), np.float64(delta_vel[1]), np.float64(delta_vel[2])
    b0, b1, b2 = _rotate_inverse(q, x, y, z)
    accumulated[0] = a0 + 0.5 * (x + b0)
    accumulated[1] = a1 + 0.5 * (y + b1)
    accumulated[2] = a2 + 0.5 * (z + b2)


@kernel
def _rotate_inverse(q, x, y, z):
    """Rotate a vector by the inverse of the unit quaternion q (w, x, y, z): v + 2 u×(u×v) - 2 w u×v."""
    w, qx, qy, qz = q
    tx = 2.0 * (qy * z - qz * y)
    ty = 2.0 * (qz * x - qx * z)
    tz = 2.0 * (qx * y - qy * x)
    return (
        x - w * tx + qy * tz - qz * ty,
        y - w * ty + qz * tx - qx * tz,
        z - w * tz + qx * ty - qy * tx,
    )
