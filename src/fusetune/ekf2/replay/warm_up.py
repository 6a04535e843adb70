"""Compile the estimator before many processes need it at once."""

from __future__ import annotations

import sys
from functools import partial

import numpy as np

from fusetune.ekf2.compiled.compilation import (
    OF_RELEASE,
    ONLY_LOADS,
    compile_and_record,
    is_compiled,
    refuse_to_compile,
)
from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.ekf2.releases.behaviours import BASELINE
from fusetune.ekf2.replay.replay import replay
from fusetune.px4.flight import Flight, TopicTable
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.complete_sets import complete

IMU_SAMPLES = 4
IMU_INTERVAL_US = 4000


def compile_kernels(release: str = BASELINE) -> None:
    """Replay a moment at rest, which compiles the estimator or loads it from the cache.

    The types of all inputs are fixed, so what is compiled for this moment serves every flight and parameter set.
    """
    flight = Flight("warm_up", topics={("sensor_combined", 0): _imu_at_rest()})
    replay(build_inputs(canonical(flight)), complete({}, {}, None), release=release)


def load_kernels() -> bool:
    """Load the estimator where it is compiled; returns whether it is."""
    if not is_compiled():
        return False
    compile_kernels()
    return True


def _imu_at_rest() -> TopicTable:
    samples = np.arange(1, IMU_SAMPLES + 1)
    columns = {f"gyro_rad[{axis}]": np.zeros(IMU_SAMPLES, np.float32) for axis in range(3)}
    columns |= {f"accelerometer_m_s2[{axis}]": np.zeros(IMU_SAMPLES, np.float32) for axis in range(3)}
    columns["accelerometer_m_s2[2]"] -= np.float32(ONE_G)
    interval = np.full(IMU_SAMPLES, IMU_INTERVAL_US, np.uint32)
    return {
        "timestamp": samples * IMU_INTERVAL_US,
        **columns,
        "gyro_integral_dt": interval,
        "accelerometer_integral_dt": interval,
        "accelerometer_timestamp_relative": np.zeros(IMU_SAMPLES, np.int32),
    }


if __name__ == "__main__":
    options = sys.argv[1:]
    release = options[options.index(OF_RELEASE) + 1] if OF_RELEASE in options else BASELINE
    if ONLY_LOADS in options:
        refuse_to_compile()
        compile_kernels()
    else:
        compile_and_record(partial(compile_kernels, release), options)
