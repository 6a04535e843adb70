"""The compiled loops: the schedule of a flight, and the filter's way along it.

Everything else that is compiled is called from here, so that Numba keeps it in one folder. None holds the
interpreter: threads can replay sets and gaps beside each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fusetune.ekf2.compiled.kernel import entry_kernel, kernel
from fusetune.ekf2.feed.buffers import size_buffers
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.covariance import reset_accel_bias, reset_gyro_bias
from fusetune.ekf2.filter.estimator import initialise_estimator, level_filter, update
from fusetune.ekf2.filter.output_predictor.output_predictor import (
    has_imu_offset,
    initialise_output_predictor,
    predict_output,
)
from fusetune.ekf2.filter.quaternion_core.quaternion_prediction import follow_newest_turn
from fusetune.ekf2.filter.world_field import save_declination
from fusetune.ekf2.replay.commands import handle_command
from fusetune.ekf2.replay.recording import EstimatorViews, begin_gap_recording, finish_recording, record_update
from fusetune.ekf2.replay.withholding import pretend_fused
from fusetune.ekf2.schedule.imu_intervals import down_sample, oldest_buffered
from fusetune.ekf2.schedule.sensor_actions import schedule_drag, schedule_sensor
from fusetune.ekf2.schedule.taking_actions import BARO, GNSS, nothing_is_due, take_actions
from fusetune.ekf2.schedule.timeline import first_at, value_at
from fusetune.ekf2.schedule.updates import schedule_updates

COMMAND, RESET_ACCEL_BIAS, RESET_GYRO_BIAS = range(3)
"""What an EVENT is."""

EVENT = np.dtype([("run", "i4"), ("what", "i4"), ("position", "i4")], align=True)
"""What acts on the filter itself before a run: a command, at a position of its array, or a reset of a bias."""

GAP_RUN = np.dtype(
    fields(
        "i8", "first_update", "last_update", "sensor", "sources", "start_us", "innovations_from", "innovations_to",
        "positions_from", "positions_to",
    ),
    align=True,
)  # fmt: skip
"""Of a gap, its updates, the last of them left out, the number of its sensor, and a bit for each of its aid sources;
filled in are the horizon when it begins, and which rows it recorded."""


class Estimator(NamedTuple):
    """An estimator: arrays of one record each, and views of the first."""

    ekf: np.ndarray
    params: np.ndarray
    recorder: np.ndarray
    views: EstimatorViews


NO_STOP = np.iinfo(np.int64).max


@entry_kernel
def find_intervals(imu, predict_us, sampler, intervals):
    """See `fusetune.ekf2.schedule.imu_intervals.down_sample`."""
    return down_sample(imu, predict_us, sampler[0], intervals)


@entry_kernel
def find_updates(intervals, imu, predict_us, delay_max_ms, start_us, lengths, levelling, updates):
    """See `fusetune.ekf2.schedule.updates.schedule_updates`; fills `lengths`, of the buffers, too."""
    size_buffers(lengths[0], value_at(predict_us, 0), delay_max_ms)
    imu_length = lengths[0].imu_length
    return schedule_updates(intervals, imu, predict_us, imu_length, start_us, levelling[0], updates)


@entry_kernel
def find_actions(arrived, times_us, delay_ms, wanted, imu, intervals, updates, lengths, ring, ring_length, actions):
    """See `fusetune.ekf2.schedule.sensor_actions.schedule_sensor`."""
    return schedule_sensor(
        arrived, times_us, delay_ms, wanted, imu, intervals, updates, lengths[0], ring[0], ring_length, actions
    )


@entry_kernel
def find_drag(enabled, imu, intervals, updates, lengths, accumulator, ring, arrived, samples, actions):
    """See `fusetune.ekf2.schedule.sensor_actions.schedule_drag`."""
    return schedule_drag(
        enabled, imu, intervals, updates, lengths[0], accumulator[0], ring[0], arrived, samples, actions
    )


@entry_kernel
def run_estimator(main, branch, inputs, schedule, notes, room, gaps, gap_room, start, stop, is_last):
    """Process the runs from `start` to before `stop`, and the gaps that begin at one of their updates.

    Parameters
    ----------
    main, branch : Estimator on its way, and one that is set up anew for every gap
    inputs, schedule, notes : samples of the flight, its schedule, and NOTE
    room, gap_room : RecordRoom for what is recorded on the way, and in all of the gaps
    gaps : GAP_RUN in order of their first updates
    is_last : the recording ends with these runs
    """
    ekf, params = main.ekf[0], main.params[0]
    updates, events = schedule.updates, schedule.events
    number, last = first_at(updates.run, start), first_at(updates.run, stop)
    event = first_at(events.run, start)
    if start == 0 and stop > 0:
        event = _handle_events(ekf, params, inputs, schedule, event, 0)
        _switch_on(ekf, params, schedule.lengths[0])
    place = first_at(schedule.actions.update, number)
    sample, from_run, gap = start, start, 0
    while True:
        while gap < len(gaps) and gaps[gap].first_update == number:
            if ekf.filter_initialised:
                _continue_into_gap(
                    main, branch, inputs, schedule, notes, gaps[gap], gap_room, place, event, sample, from_run
                )
            gap += 1
        if number == last:
            break
        until = last if gap == len(gaps) else min(last, gaps[gap].first_update)
        place, event, sample = _go_on(
            ekf, params, inputs, schedule, notes, main.views, main.recorder[0], room, number, until, place, event,
            sample, from_run,
        )  # fmt: skip
        number, from_run = until, 0
    while events[event].run < stop:
        sample = _predict_output_until(ekf, params, inputs.imu, sample, events[event].run)
        event = _handle_events(ekf, params, inputs, schedule, event, events[event].run)
    if stop > start:
        take_actions(ekf, params, inputs, schedule, place, number, from_run, stop, False, notes)
        _predict_output_until(ekf, params, inputs.imu, sample, stop)
        _set_clock(ekf, inputs, schedule, stop)
    if is_last:
        finish_recording(ekf, params, main.recorder[0], room)


@kernel
def _go_on(ekf, params, inputs, schedule, notes, views, recorder, room, number, until, place, event, sample, from_run):
    """Process the updates from `number` to before `until`.

    `place`, `event` and `sample` are the next action, event and IMU sample; returned is what they are then. Of the
    first update's arrivals, those before `from_run` have been carried out already.
    """
    updates, events, imu = schedule.updates, schedule.events, inputs.imu
    while number < until:
        run = updates[number].run
        while events[event].run <= run:
            sample = _predict_output_until(ekf, params, imu, sample, events[event].run)
            event = _handle_events(ekf, params, inputs, schedule, event, events[event].run)
        sample = _predict_output_until(ekf, params, imu, sample, run + 1)
        _set_horizon(ekf, schedule.intervals[updates[number].delayed])
        ekf.time_latest_us = imu[run].time_us
        ekf.dt_ekf_avg = updates[number].average_dt
        nothing_is_due(ekf.sensors)
        place = take_actions(ekf, params, inputs, schedule, place, number, from_run, NO_STOP, True, notes)
        from_run = 0
        pretend_fused(ekf)
        if not ekf.filter_initialised:
            level_filter(ekf, params, schedule.levelling[0])
        update(ekf, params)
        save_declination(ekf, params)
        record_update(ekf, params, views, recorder, room, ekf.time_latest_us)
        number += 1
    return place, event, sample


@kernel
def _continue_into_gap(main, branch, inputs, schedule, notes, gap, room, place, event, sample, from_run):
    """Go on without a sensor, on a copy of the estimator; what is recorded follows what was in other gaps."""
    branch.ekf[0] = main.ekf[0]
    branch.params[0] = main.params[0]
    ekf, recorder = branch.ekf[0], branch.recorder[0]
    for source in range(len(recorder.last_sample)):
        recorder.last_sample[source] = main.recorder[0].last_sample[source]
    begin_gap_recording(recorder, gap.sources)
    gap.innovations_from, gap.positions_from = recorder.innovation_rows, recorder.position_rows
    gap.start_us = ekf.time_delayed_us
    if gap.sensor == GNSS:
        ekf.sensors.gnss.withheld = True
    elif gap.sensor == BARO:
        ekf.sensors.baro.withheld = True
    else:
        ekf.sensors.mag.withheld = True
    _go_on(
        ekf, branch.params[0], inputs, schedule, notes, branch.views, recorder, room, gap.first_update,
        gap.last_update, place, event, sample, from_run,
    )  # fmt: skip
    finish_recording(ekf, branch.params[0], recorder, room)
    gap.innovations_to, gap.positions_to = recorder.innovation_rows, recorder.position_rows


@kernel
def _switch_on(ekf, params, lengths):
    ekf.buffers.imu_length = lengths.imu_length
    ekf.buffers.observation_length = lengths.observation_length
    initialise_output_predictor(ekf)
    initialise_estimator(ekf, params)


@kernel
def _handle_events(ekf, params, inputs, schedule, event, run):
    """Carry out the events of one run, between what the run before left and what this one does itself."""
    events = schedule.events
    while events[event].run == run:
        _set_clock(ekf, inputs, schedule, run)
        if events[event].what == COMMAND:
            handle_command(ekf, params, inputs.command[events[event].position])
        elif events[event].what == RESET_ACCEL_BIAS:
            reset_accel_bias(ekf, params)
        else:
            reset_gyro_bias(ekf, params)
        event += 1
    return event


@kernel
def _predict_output_until(ekf, params, imu, sample, stop):
    """Integrate the IMU samples from index `sample` to before `stop` at the full rate; return where it is now."""
    has_offset = has_imu_offset(ekf.output, params)
    while sample < stop:
        follow_newest_turn(ekf, imu[sample])
        predict_output(ekf.output, params, imu[sample], has_offset)
        sample += 1
    return sample


@kernel
def _set_clock(ekf, inputs, schedule, stop):
    """The times that the estimator knows when the runs before `stop` are over."""
    if stop == 0:
        return
    ekf.time_latest_us = inputs.imu[stop - 1].time_us
    newest = first_at(schedule.intervals.run, stop) - 1
    if newest < 0:
        ekf.time_delayed_us = inputs.imu[0].time_us
        return
    _set_horizon(ekf, schedule.intervals[oldest_buffered(newest, schedule.lengths[0].imu_length)])


@kernel
def _set_horizon(ekf, interval):
    imu = ekf.imu_delayed
    ekf.time_delayed_us = interval.time_us
    imu.time_us = interval.time_us
    imu.delta_ang_dt = interval.delta_ang_dt
    imu.delta_vel_dt = interval.delta_vel_dt
    for axis in range(3):
        imu.delta_ang[axis] = interval.delta_ang[axis]
        imu.delta_vel[axis] = interval.delta_vel[axis]
        imu.delta_vel_clipping[axis] = interval.delta_vel_clipping[axis]
