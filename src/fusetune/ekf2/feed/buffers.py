"""Ring buffers that carry every sample from its arrival to the fusion time horizon.

The estimator runs a fixed time behind the newest IMU sample. A sample of an aiding sensor waits in a ring until the
horizon has passed its time stamp; of several that are due, the newest wins and the older ones are dropped. The replay
has all samples in arrays already, so a ring holds only time stamps and positions in those arrays; and since no state
of the filter enters, the rings of a flight are run through once, before it is replayed (`fusetune.ekf2.schedule`).

Mirrors PX4 v1.16 `EKF/RingBuffer.h` and the `set…Data` functions of `EKF/estimator_interface.cpp`, including two traits
that change results: a ring that was emptied forgets the time of its newest sample, and samples that arrive faster than
the horizon moves through the ring are refused.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields

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

BUFFER_LENGTHS = np.dtype(fields("i8", "imu_length", "observation_length"), align=True)
"""The estimator's sub-record `ekf.buffers`: places of the IMU's buffer, and of those of observations."""


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
def size_buffers(lengths, predict_us, delay_max_ms):
    """Lengths of the buffers by EKF2_PREDICT_US and the longest delay, which act on them at start-up only."""
    update_period_ms = predict_us / 1000.0
    imu_length = min(max(2, int(np.ceil(delay_max_ms / update_period_ms))), RING_CAPACITY - 1)
    lengths.imu_length = imu_length
    lengths.observation_length = min(int(np.floor(1.5 * delay_max_ms / update_period_ms + 0.5)), imu_length)


@kernel
def offer(ring, sample_time_us, delay_ms, average_interval_s, least_us, slot):
    """Buffer an aiding sample unless it follows the newest one by less than `least_us`.

    Its time stamp becomes the measurement time: less the sensor's delay, less half an estimator interval, both cut
    to whole microseconds as PX4 does. Returns whether the sample was taken.
    """
    delay_us = int(np.float32(delay_ms) * np.float32(1000.0))
    time_us = sample_time_us - delay_us - int(np.float32(average_interval_s) * np.float32(5e5))
    if time_us < newest_time_us(ring) + least_us:
        return False
    push(ring, time_us, slot)
    return True
