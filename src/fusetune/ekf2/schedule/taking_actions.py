"""Carry out what a schedule has for the sensors before an update: samples arrive, others are due.

`inputs` is the named tuple of sample arrays that `fusetune.ekf2.feed.inputs` builds. What arrives can change what the
estimator knows of the sensor at once; PX4's `EKF2.cpp` does that where it reads the message.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sample_arrival import apply_antenna_yaw_offset, apply_vision_noise
from fusetune.ekf2.feed.sensors import SENSOR_MEMORIES
from fusetune.ekf2.filter.aid_sources.gnss.gnss_arrival import look_at_arrived_gnss, recall_arrived_gnss
from fusetune.ekf2.filter.common.conditions import follow_system_flags_at_once
from fusetune.ekf2.releases.by_release import by_release
from fusetune.ekf2.schedule.imu_intervals import oldest_buffered
from fusetune.ekf2.schedule.sensor_actions import BUFFERED, DUE
from fusetune.ekf2.schedule.timeline import first_at, place_at

SENSOR_NAMES = tuple(SENSOR_MEMORIES)
"""In the order of their numbers in an ACTION."""

(GNSS, MAG, BARO, RANGE, FLOW, EV, AIRSPEED, AUXVEL, DRAG, SYSTEM_FLAGS) = range(len(SENSOR_NAMES))


@kernel
def nothing_is_due(sensors):
    """What was due at the last update no longer is."""
    sensors.gnss.data_ready = False
    sensors.mag.data_ready = False
    sensors.baro.data_ready = False
    sensors.range.data_ready = False
    sensors.flow.data_ready = False
    sensors.ev.data_ready = False
    sensors.airspeed.data_ready = False
    sensors.auxvel.data_ready = False
    sensors.drag.data_ready = False
    sensors.system_flags.data_ready = False


@kernel
def take_actions(ekf, params, inputs, schedule, place, update, from_run, stop_run, with_due, notes):
    """Carry out the actions before an update, from index `place` on; return the index of the first of a later one.

    Parameters
    ----------
    schedule : of the flight, with the samples of drag, which stand in no input
    from_run, stop_run : only what arrives at the runs between is carried out
    with_due : whether samples that are due are taken
    notes : NOTE, what the parameters said since when
    """
    actions = schedule.actions
    while actions[place].update == update:
        action = actions[place]
        if action.what == DUE:
            if with_due:
                _take_due(ekf, inputs, schedule.drag, action, notes)
                if action.sensor == FLOW:
                    _note_interval(ekf, inputs, action)
        elif from_run <= action.run < stop_run:
            _arrive(ekf, params, inputs, schedule, action)
        place += 1
    return place


@kernel
def _need_no_interval(ekf, inputs, action):
    """Since v1.15 flow is a rate."""


@kernel
def _note_flow_interval(ekf, inputs, action):
    ekf.flow_interval = inputs.flow_limits[action.slot, 3] * 1e-6


_note_interval = by_release(_need_no_interval, "integrates_flow", _note_flow_interval)
"""Over what time (s) the flow was integrated."""


@kernel
def _arrive(ekf, params, inputs, schedule, action):
    sensors, slot, sensor = ekf.sensors, action.slot, action.sensor
    if sensor == MAG:
        _note_arrival(sensors.mag, action)
    elif sensor == BARO:
        ekf.air_density = inputs.air_density[slot]
        _note_arrival(sensors.baro, action)
    elif sensor == GNSS:
        _note_arrival(sensors.gnss, action)
        if action.what == BUFFERED and math.isfinite(inputs.gnss[slot].yaw):
            sensors.gnss.newest_yaw_time_us = action.time_us
        if action.what == BUFFERED:
            _gnss_arrives(ekf, params, inputs, schedule, action)
    elif sensor == RANGE:
        ekf.range.sensor_min_distance = inputs.range_limits[slot, 0]
        ekf.range.sensor_max_distance = inputs.range_limits[slot, 1]
        _note_arrival(sensors.range, action)
    elif sensor == FLOW:
        ekf.flow.max_rate = inputs.flow_limits[slot, 0]
        ekf.flow.min_distance = inputs.flow_limits[slot, 1]
        ekf.flow.max_distance = inputs.flow_limits[slot, 2]
        _note_arrival(sensors.flow, action)
    elif sensor == EV:
        if action.what == BUFFERED:
            ekf.ev.newest_quality = inputs.ev[slot].quality
        _note_arrival(sensors.ev, action)
    elif sensor == AIRSPEED:
        _note_arrival(sensors.airspeed, action)
    elif sensor == AUXVEL:
        _note_arrival(sensors.auxvel, action)
    elif sensor == DRAG:
        _note_arrival(sensors.drag, action)
    else:
        _note_arrival(sensors.system_flags, action)


@kernel
def _wait_until_due(ekf, params, inputs, schedule, action):
    """v1.15 looks at a sample when it is due."""


@kernel
def _look_at_gnss(ekf, params, inputs, schedule, action):
    """Look at a sample with the clocks at its run, which may be before that of the update to come."""
    delayed_us, latest_us = ekf.time_delayed_us, ekf.time_latest_us
    ekf.time_latest_us = inputs.imu[action.run].time_us
    newest = first_at(schedule.intervals.run, action.run + 1) - 1
    if newest < 0:
        ekf.time_delayed_us = inputs.imu[0].time_us
    else:
        ekf.time_delayed_us = schedule.intervals[oldest_buffered(newest, schedule.lengths[0].imu_length)].time_us
    look_at_arrived_gnss(ekf, params, inputs.gnss[action.slot], action.slot)
    ekf.time_delayed_us, ekf.time_latest_us = delayed_us, latest_us


_gnss_arrives = by_release(_wait_until_due, "checks_gnss_on_arrival", _look_at_gnss)


@kernel
def _apply_to_all(ekf, sample, note):
    apply_vision_noise(sample, note)


@kernel
def _apply_but_to_velocity(ekf, sample, note):
    """The variances that the sample tells of its velocity stay as they are."""
    north, east, down = sample.velocity_var[0], sample.velocity_var[1], sample.velocity_var[2]
    apply_vision_noise(sample, note)
    if note.noise_mode == 0 and math.isfinite(north) and math.isfinite(east) and math.isfinite(down):
        sample.velocity_var[0], sample.velocity_var[1], sample.velocity_var[2] = north, east, down


_apply_noise_of_vision = by_release(_apply_to_all, "fuses_vision_by_mask", _apply_but_to_velocity)


@kernel
def _note_arrival(sensor, action):
    sensor.exists = True
    if action.what == BUFFERED:
        sensor.newest_time_us = action.time_us


@kernel
def _take_due(ekf, inputs, drag, action, notes):
    sensors, sensor = ekf.sensors, action.sensor
    if sensor == MAG:
        _take(sensors.mag, inputs.mag, action)
    elif sensor == BARO:
        _take(sensors.baro, inputs.baro, action)
    elif sensor == GNSS:
        _take(sensors.gnss, inputs.gnss, action)
        apply_antenna_yaw_offset(sensors.gnss.sample, notes[place_at(notes, action.run)])
        recall_arrived_gnss(ekf, action.slot)
    elif sensor == RANGE:
        _take(sensors.range, inputs.range, action)
    elif sensor == FLOW:
        _take(sensors.flow, inputs.flow, action)
    elif sensor == EV:
        _take(sensors.ev, inputs.ev, action)
        _apply_noise_of_vision(ekf, sensors.ev.sample, notes[place_at(notes, action.run)])
    elif sensor == AIRSPEED:
        _take(sensors.airspeed, inputs.airspeed, action)
    elif sensor == AUXVEL:
        _take(sensors.auxvel, inputs.auxvel, action)
    elif sensor == DRAG:
        _take(sensors.drag, drag, action)
    else:
        _take_flags(ekf, inputs, action)


@kernel
def _keep_flags_for_control(ekf, inputs, action):
    _take(ekf.sensors.system_flags, inputs.system_flags, action)


@kernel
def _follow_flags(ekf, inputs, action):
    before_us = ekf.time_delayed_us
    ekf.time_delayed_us = inputs.imu[action.run].time_us
    follow_system_flags_at_once(ekf, inputs.system_flags[action.slot])
    ekf.time_delayed_us = before_us


_take_flags = by_release(_keep_flags_for_control, "follows_flags_at_once", _follow_flags)


@kernel
def _take(sensor, samples, action):
    sensor.data_ready = True
    sensor.sample = samples[action.slot]
    sensor.sample.time_us = action.time_us
