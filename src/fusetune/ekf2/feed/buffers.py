"""Ring buffers that carry every sample from its arrival to the fusion time horizon.

The estimator runs a fixed time behind the newest IMU sample. A sample of an aiding sensor waits in a ring until the
horizon has passed its time stamp; of several that are due, the newest wins and the older ones are dropped. The replay
has all samples in arrays already, so a ring holds only time stamps and positions in those arrays.

Mirrors PX4 v1.16 `EKF/RingBuffer.h` and the `set…Data` functions of `EKF/estimator_interface.cpp`, including two traits
that change results: a ring that was emptied forgets the time of its newest sample, and samples that arrive faster than
the horizon moves through the ring are refused.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.feed.sensor_samples import IMU_SAMPLE

RING_CAPACITY = 256
"""PX4 counts buffer entries in eight bits, so no buffer can be longer."""

MAX_SAMPLE_AGE_US = 100_000

RING = np.dtype(
    [
        *fields("i8", "time_us", "slot", shape=(RING_CAPACITY,)),
        *fields("i8", "head", "tail", "size"),
        ("first_write", "?"),
    ],
    align=True,
)

IMU_RING = np.dtype(
    [
        ("sample", IMU_SAMPLE, (RING_CAPACITY,)),
        *fields("i8", "head", "tail", "size"),
        ("first_write", "?"),
    ],
    align=True,
)

BUFFERS_MEMORY = np.dtype(
    [
        ("imu", IMU_RING),
        *fields("i8", "imu_length", "observation_length", "min_observation_interval_us"),
        ("initialised", "?"),
    ],
    align=True,
)
"""The estimator's sub-record `ekf.buffers`: the IMU's ring, and the lengths of all; those of the sensors are theirs."""


@kernel
def reset_ring(ring, size):
    """Empty a ring and give it `size` places."""
    ring.time_us[:] = 0
    ring.head = 0
    ring.tail = 0
    ring.size = size
    ring.first_write = True


@kernel
def advance_for_write(ring):
    """Move the write position of a ring on and return it; the oldest entry gives way when the ring is full."""
    head = ring.head
    if not ring.first_write:
        head = (head + 1) % ring.size
    ring.head = head
    if head == ring.tail and not ring.first_write:
        ring.tail = (ring.tail + 1) % ring.size
    else:
        ring.first_write = False
    return head


@kernel
def push(ring, time_us, slot):
    """Add the sample at position `slot` of its array, measured at `time_us`."""
    head = advance_for_write(ring)
    ring.time_us[head] = time_us
    ring.slot[head] = slot


@kernel
def may_be_due(ring, horizon_us):
    """False where `find_newest_due` finds nothing: the oldest is yet to come, or the newest is too old or taken."""
    return ring.time_us[ring.tail] <= horizon_us < ring.time_us[ring.head] + MAX_SAMPLE_AGE_US


@kernel
def find_newest_due(ring, horizon_us):
    """Index in the ring of the newest sample due at the horizon and at most 0.1 s old, or -1."""
    for age in range(ring.size):
        index = (ring.head - age) % ring.size
        if ring.time_us[index] <= horizon_us < ring.time_us[index] + MAX_SAMPLE_AGE_US:
            return index
        if index == ring.tail:
            break
    return -1


@kernel
def take(ring, index):
    """Remove the entry at `index` together with everything older."""
    if index == ring.head:
        ring.tail = ring.head
        ring.first_write = True
    else:
        ring.tail = (index + 1) % ring.size
    ring.time_us[index] = 0


@kernel
def newest_time_us(ring):
    """Time stamp of the newest sample, 0 when it was taken already."""
    return ring.time_us[ring.head]


@kernel
def initialise_buffers(ekf, params, time_us):
    """Size the buffers from EKF2_DELAY_MAX and EKF2_PREDICT_US; both act at start-up only."""
    update_period_ms = params.EKF2_PREDICT_US / 1000.0
    imu_length = min(max(2, int(np.ceil(params.EKF2_DELAY_MAX / update_period_ms))), RING_CAPACITY - 1)
    observation_length = min(int(np.floor(1.5 * params.EKF2_DELAY_MAX / update_period_ms + 0.5)), imu_length)
    buffers = ekf.buffers
    buffers.imu_length = imu_length
    buffers.observation_length = observation_length
    buffers.min_observation_interval_us = 0
    buffers.imu.head = 0
    buffers.imu.tail = 0
    buffers.imu.size = imu_length
    buffers.imu.first_write = True
    sensors = ekf.sensors
    reset_ring(sensors.gnss.ring, observation_length)
    reset_ring(sensors.mag.ring, observation_length)
    reset_ring(sensors.baro.ring, observation_length)
    reset_ring(sensors.range.ring, observation_length)
    reset_ring(sensors.flow.ring, imu_length)
    reset_ring(sensors.ev.ring, observation_length)
    reset_ring(sensors.airspeed.ring, observation_length)
    reset_ring(sensors.auxvel.ring, observation_length)
    reset_ring(sensors.system_flags.ring, observation_length)
    reset_ring(sensors.drag.ring, observation_length)
    buffers.initialised = True
    ekf.time_delayed_us = time_us
    ekf.time_latest_us = time_us


@kernel
def push_imu(ekf, time_latest_us):
    """Buffer the down-sampled IMU sample in `ekf.imu_newest` and move the fusion time horizon."""
    buffers = ekf.buffers
    buffers.imu.sample[advance_for_write(buffers.imu)] = ekf.imu_newest
    ekf.imu_delayed = buffers.imu.sample[buffers.imu.tail]
    ekf.time_delayed_us = ekf.imu_delayed.time_us
    intervals = buffers.observation_length - 1
    # ARM divides by zero to zero, and PX4 relies on it when all delays are tiny.
    buffers.min_observation_interval_us = (time_latest_us - ekf.time_delayed_us) // intervals if intervals > 0 else 0


@kernel
def offer(ekf, ring, sample_time_us, delay_ms, slot):
    """Buffer an aiding sample unless it follows the newest one too closely.

    Its time stamp becomes the measurement time: less the sensor's delay, less half an estimator interval, both cut
    to whole microseconds as PX4 does. Returns whether the sample was taken.
    """
    delay_us = int(np.float32(delay_ms) * np.float32(1000.0))
    time_us = sample_time_us - delay_us - int(np.float32(ekf.dt_ekf_avg) * np.float32(5e5))
    if time_us < newest_time_us(ring) + ekf.buffers.min_observation_interval_us:
        return False
    push(ring, time_us, slot)
    return True
