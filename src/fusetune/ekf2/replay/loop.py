"""The compiled loop: at every IMU sample what PX4's EKF2 module does in one run.

Take the IMU sample, the newest message of every aiding topic, the system flags; update the filter; publish.
"""

from __future__ import annotations

import numpy as np

from fusetune.ekf2.compiled.kernel import entry_kernel, kernel
from fusetune.ekf2.feed.buffers import initialise_buffers, push_imu
from fusetune.ekf2.feed.sample_arrival import receive_aiding, receive_drag
from fusetune.ekf2.filter.aid_sources.drag.drag_accumulator import accumulate_drag
from fusetune.ekf2.filter.aid_sources.magnetometer.world_field import save_declination
from fusetune.ekf2.filter.covariance import reset_accel_bias, reset_gyro_bias
from fusetune.ekf2.filter.estimator import initialise_estimator, update
from fusetune.ekf2.filter.imu_down_sampler.imu_down_sampler import (
    accumulate_imu,
    initialise_down_sampler,
    reset_down_sampler,
)
from fusetune.ekf2.filter.output_predictor.output_predictor import initialise_output_predictor, predict_output
from fusetune.ekf2.replay.commands import handle_command
from fusetune.ekf2.replay.recording import record_update
from fusetune.ekf2.replay.withholding import pretend_fused

MIN_DT_FACTOR, MAX_DT_FACTOR = np.float32(0.5), np.float32(2.0)


@entry_kernel
def run_estimator(ekf, params, inputs, views, recorder, records, runs, horizon_us):
    """Process a stretch of a flight, to its end or until the fusion time horizon has come to `horizon_us`.

    `inputs` are of its runs; returned is how many were processed.
    """
    for run in range(runs):
        arrivals = inputs.arrivals[run]
        if arrivals.command >= 0:
            handle_command(ekf, params, inputs.command[arrivals.command])
        if arrivals.reset_accel_bias:
            reset_accel_bias(ekf, params)
        if arrivals.reset_gyro_bias:
            reset_gyro_bias(ekf, params)
        receive_imu(ekf, params, inputs.imu[run])
        receive_aiding(ekf, params, inputs, arrivals)
        if ekf.imu_updated:
            pretend_fused(ekf)
        if update(ekf, params, inputs):
            save_declination(ekf, params)
            record_update(ekf, params, views, recorder, records, inputs.imu[run].time_us)
        if ekf.time_delayed_us >= horizon_us:
            return run + 1
    return runs


@kernel
def receive_imu(ekf, params, imu):
    """Feed the output predictor and the down-sampler; move the horizon when an interval is complete."""
    if not ekf.buffers.initialised:
        initialise_buffers(ekf, params, imu.time_us)
        initialise_down_sampler(ekf.down_sampler)
        initialise_output_predictor(ekf)
        initialise_estimator(ekf, params)
    ekf.time_latest_us = imu.time_us
    predict_output(ekf, params, imu)
    if accumulate_imu(ekf.down_sampler, imu):
        ekf.imu_newest = ekf.down_sampler.sample
        reset_down_sampler(ekf.down_sampler, params)
        period = np.float32(params.EKF2_PREDICT_US) * np.float32(1e-6)
        low, high = MIN_DT_FACTOR * period, MAX_DT_FACTOR * period
        ekf.imu_newest.delta_ang_dt = min(max(np.float32(ekf.imu_newest.delta_ang_dt), low), high)
        ekf.imu_newest.delta_vel_dt = min(max(np.float32(ekf.imu_newest.delta_vel_dt), low), high)
        push_imu(ekf, imu.time_us)
        ekf.imu_updated = True
    buffers = ekf.buffers
    if accumulate_drag(ekf, params, imu, buffers.imu_length, buffers.observation_length):
        receive_drag(ekf.sensors.drag, ekf.drag.produced)
