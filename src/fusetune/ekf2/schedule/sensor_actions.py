"""What arrives of a sensor before each update, and which of its samples is due then.

A sample waits in the sensor's ring (`fusetune.ekf2.feed.buffers`) from its arrival until the fusion time horizon has
passed its time of measurement. Whether it finds room, and when it is due, follows from the times of the flight, the
sensor's delay and the lengths of the buffers; no state of the filter enters.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.buffers import find_newest_due, may_be_due, newest_time_us, offer, push, reset_ring, take
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.aid_sources.drag.drag_accumulator import accumulate_drag, may_average
from fusetune.ekf2.schedule.imu_intervals import oldest_buffered
from fusetune.ekf2.schedule.timeline import value_at
from fusetune.ekf2.schedule.updates import INITIAL_INTERVAL_S

ACTION = np.dtype(
    [("time_us", "i8"), *fields("i4", "update", "run", "slot"), *fields("i1", "sensor", "what")], align=True
)
"""Before which update something happens to a sensor: the sample at `slot` of its array arrives at a run, or is due.

Of a sample that is due, `time_us` is the time of its measurement, `run` that at which it arrived.
"""

REFUSED, BUFFERED, DUE = 0, 1, 2
"""What happens: a sample arrives and finds no room, or does, or is due."""

ARRIVED = np.dtype([*fields("i4", "run", "slot")], align=True)


@kernel
def schedule_sensor(arrived, times_us, delay_ms, wanted, imu, intervals, updates, lengths, ring, ring_length, actions):
    """Fill `actions` with those of one sensor; return how many there are.

    Parameters
    ----------
    arrived : ARRIVED in order of the runs
    times_us : of all samples of the sensor
    delay_ms, wanted : TIMELINE of its delay, and of whether the filter asks for its samples (0 or 1)
    imu, intervals, updates : IMU_ROW of every run, IMU_INTERVAL and UPDATE of the flight
    lengths : of the buffers of the IMU and of observations
    ring : RING record, to work with, and how many places it has
    actions : ACTION, twice as many as arrive
    """
    reset_ring(ring, ring_length)
    count, update, newest = 0, 0, -1
    for place in range(len(arrived)):
        run, slot = arrived[place].run, arrived[place].slot
        while update < len(updates) and updates[update].run < run:
            count = _take_due(ring, arrived, wanted, intervals, updates, update, actions, count)
            update += 1
        if update == len(updates):
            return count
        while newest + 1 < len(intervals) and intervals[newest + 1].run <= run:
            newest += 1
        average = updates[update - 1].average_dt if update > 0 else INITIAL_INTERVAL_S
        least = min_observation_interval_us(intervals, newest, lengths)
        what = REFUSED
        if offer(ring, times_us[slot], value_at(delay_ms, run), average, least, place):
            what = BUFFERED
        count = _act(actions, count, update, what, run, slot, imu[run].time_us)
    return _take_rest(ring, arrived, wanted, intervals, updates, update, actions, count)


@kernel
def min_observation_interval_us(intervals, newest, lengths):
    """Time between two samples below which the later is refused, by what the buffer of observations spans."""
    parts = lengths.observation_length - 1
    if newest < 0 or parts <= 0:
        # ARM divides by zero to zero, and PX4 relies on it when all delays are tiny
        return 0
    return (intervals[newest].time_us - intervals[oldest_buffered(newest, lengths.imu_length)].time_us) // parts


@kernel
def schedule_drag(enabled, imu, intervals, updates, lengths, accumulator, ring, arrived, samples, actions):
    """Fill `samples` (DRAG_SAMPLE) with means of the specific force, and `actions` with what becomes of them.

    They are made at the rate of the filter, so none is refused. `enabled` is the TIMELINE of EKF2_DRAG_CTRL > 0;
    `arrived` is work space, as long as `samples`. Returns how many samples and how many actions there are.
    """
    reset_ring(ring, lengths.observation_length)
    made, count, update, interval, exists = 0, 0, 0, 0, False
    for run in range(len(imu)):
        while update < len(updates) and updates[update].run < run:
            count = _take_due(ring, arrived, enabled, intervals, updates, update, actions, count)
            update += 1
        if update == len(updates):
            return made, count
        while interval < len(intervals) and intervals[interval].run < run:
            interval += 1
        ends_interval = interval < len(intervals) and intervals[interval].run == run
        if value_at(enabled, run) == 0.0 or not may_average(accumulator, ends_interval):
            continue
        if not exists:
            exists = True
            count = _act(actions, count, update, REFUSED, run, -1, imu[run].time_us)
        if accumulate_drag(accumulator, imu[run], lengths.imu_length, lengths.observation_length):
            samples[made] = accumulator.produced
            arrived[made].run, arrived[made].slot = run, made
            push(ring, samples[made].time_us, made)
            made += 1
    return made, _take_rest(ring, arrived, enabled, intervals, updates, update, actions, count)


@kernel
def _take_due(ring, arrived, wanted, intervals, updates, update, actions, count):
    """Take from the ring what is due at an update; what is not wanted stays there.

    Wanted again, a sensor starts with the newest sample of the last 0.1 s.
    """
    horizon_us = intervals[updates[update].delayed].time_us
    if not may_be_due(ring, horizon_us) or value_at(wanted, updates[update].run) == 0.0:
        return count
    index = find_newest_due(ring, horizon_us)
    if index < 0 or ring.time_us[index] == 0:  # an empty place, in the first tenth of a second after boot
        return count
    one = arrived[ring.slot[index]]
    count = _act(actions, count, update, DUE, one.run, one.slot, ring.time_us[index])
    take(ring, index)
    return count


@kernel
def _take_rest(ring, arrived, wanted, intervals, updates, update, actions, count):
    while update < len(updates) and newest_time_us(ring) != 0:
        count = _take_due(ring, arrived, wanted, intervals, updates, update, actions, count)
        update += 1
    return count


@kernel
def _act(actions, count, update, what, run, slot, time_us):
    action = actions[count]
    action.update, action.what, action.run, action.slot, action.time_us = update, what, run, slot, time_us
    return count + 1
