"""Hand the samples that arrived with one IMU sample to the buffers, and take those due at the fusion time horizon.

`receive` runs when a sample of any sensor arrives, `pop` when the horizon moves; both work on the sensor's sub-record
(`fusetune.ekf2.feed.sensors`). `inputs` is the named tuple of sample arrays that `fusetune.ekf2.feed.inputs` builds.
What parameters say of a sample's noise or mounting is what they said when it arrived.

Mirrors the `set…Data` functions of PX4 v1.16 `EKF/estimator_interface.cpp`, and what `EKF2.cpp` does before it calls
them.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.buffers import RING_CAPACITY, find_newest_due, may_be_due, offer, push, take

NO_DELAY_MS = 0.0


@kernel
def receive(ekf, sensor, samples, slot, delay_ms):
    """Buffer the sample at position `slot` of `samples`; return whether it was taken.

    Parameters
    ----------
    sensor : sub-record of `ekf.sensors`
    delay_ms : the sensor's delay against the IMU
    """
    sensor.exists = True
    if not offer(ekf, sensor.ring, samples[slot].time_us, delay_ms, slot):
        return False
    sensor.newest_time_us = ekf.time_latest_us
    return True


@kernel
def pop(ekf, sensor, samples, wanted):
    """Take the sample that is due into `sensor.sample`, and tell by `sensor.data_ready` whether one was.

    What is not wanted leaves its samples in the ring; wanted again, it starts with the newest of the last 0.1 s.

    Returns
    -------
    int : place in the ring that the sample had, -1 without one
    """
    sensor.data_ready = False
    if not wanted or not may_be_due(sensor.ring, ekf.time_delayed_us):
        return -1
    return _take_newest_due(ekf, sensor, samples)


@kernel
def _take_newest_due(ekf, sensor, samples):
    """The longer part of `pop`, apart so that the compiler joins the shorter one, mostly enough, with its callers."""
    place = find_newest_due(sensor.ring, ekf.time_delayed_us)
    if place >= 0:
        sensor.data_ready = True
        sensor.sample = samples[sensor.ring.slot[place]]
        sensor.sample.time_us = sensor.ring.time_us[place]
        take(sensor.ring, place)
    return place


@kernel
def is_fusion_due(sensor):
    """Whether the filter is to use the sample in hand: there is one, and no experiment withholds the sensor."""
    return sensor.data_ready and not sensor.withheld


@kernel
def receive_aiding(ekf, params, inputs, arrivals):
    """Buffer what arrived with this IMU sample, in the order of PX4's module."""
    sensors = ekf.sensors
    if arrivals.airspeed >= 0:
        receive(ekf, sensors.airspeed, inputs.airspeed, arrivals.airspeed, params.EKF2_ASP_DELAY)
    if arrivals.auxvel >= 0:
        receive(ekf, sensors.auxvel, inputs.auxvel, arrivals.auxvel, params.EKF2_AVEL_DELAY)
    if arrivals.baro >= 0:
        ekf.air_density = inputs.air_density[arrivals.baro]
        receive(ekf, sensors.baro, inputs.baro, arrivals.baro, params.EKF2_BARO_DELAY)
    if arrivals.ev >= 0 and receive(ekf, sensors.ev, inputs.ev, arrivals.ev, params.EKF2_EV_DELAY):
        note_vision_noise(sensors.ev, params)
        ekf.ev.newest_quality = inputs.ev[arrivals.ev].quality
    if arrivals.flow >= 0:
        ekf.flow.max_rate = inputs.flow_limits[arrivals.flow, 0]
        ekf.flow.min_distance = inputs.flow_limits[arrivals.flow, 1]
        ekf.flow.max_distance = inputs.flow_limits[arrivals.flow, 2]
        receive(ekf, sensors.flow, inputs.flow, arrivals.flow, params.EKF2_OF_DELAY)
    if arrivals.gnss >= 0 and receive(ekf, sensors.gnss, inputs.gnss, arrivals.gnss, params.EKF2_GPS_DELAY):
        note_antenna_yaw_offset(sensors.gnss, params)
        if np.isfinite(inputs.gnss[arrivals.gnss].yaw):
            sensors.gnss.newest_yaw_time_us = ekf.time_latest_us
    if arrivals.mag >= 0:
        receive(ekf, sensors.mag, inputs.mag, arrivals.mag, params.EKF2_MAG_DELAY)
    if arrivals.range >= 0:
        receive(ekf, sensors.range, inputs.range, arrivals.range, params.EKF2_RNG_DELAY)
        ekf.range.sensor_min_distance = inputs.range_limits[arrivals.range, 0]
        ekf.range.sensor_max_distance = inputs.range_limits[arrivals.range, 1]
    if arrivals.system_flags >= 0:
        receive(ekf, sensors.system_flags, inputs.system_flags, arrivals.system_flags, NO_DELAY_MS)


@kernel
def receive_drag(drag, sample):
    """Buffer a down-sampled specific force; as it is made at the rate of the filter, none is refused."""
    slot = drag.made_count % RING_CAPACITY
    drag.made[slot] = sample
    drag.made_count += 1
    push(drag.ring, sample.time_us, slot)


@kernel
def note_antenna_yaw_offset(gnss, params):
    """Keep EKF2_GPS_YAW_OFF beside the sample just buffered."""
    gnss.yaw_offset_deg[gnss.ring.head] = params.EKF2_GPS_YAW_OFF


@kernel
def apply_antenna_yaw_offset(gnss, place):
    """Of the sample popped from a place: use EKF2_GPS_YAW_OFF where a heading was reported but no offset of its own."""
    if place < 0:
        return
    sample, offset = gnss.sample, np.deg2rad(gnss.yaw_offset_deg[place])
    if abs(offset) > 0.0 and not np.isfinite(sample.yaw_offset) and np.isfinite(sample.yaw):
        offset = np.arctan2(np.sin(offset), np.cos(offset))
        sample.yaw_offset = offset
        sample.yaw = np.arctan2(np.sin(sample.yaw - offset), np.cos(sample.yaw - offset))


@kernel
def note_vision_noise(ev, params):
    """Keep the noise parameters beside the sample just buffered."""
    noise = ev.noise[ev.ring.head]
    noise.position = params.EKF2_EVP_NOISE
    noise.velocity = params.EKF2_EVV_NOISE
    noise.attitude = params.EKF2_EVA_NOISE
    noise.mode = int(params.EKF2_EV_NOISE_MD)


@kernel
def apply_vision_noise(ev, place):
    """Of the sample popped from a place: replace its variances by the parameters, or floor them (EKF2_EV_NOISE_MD)."""
    if place < 0:
        return
    sample, noise = ev.sample, ev.noise[place]
    use_reported = noise.mode == 0
    _floor_variance(sample.position_var, noise.position, use_reported)
    _floor_variance(sample.velocity_var, noise.velocity, use_reported)
    _floor_variance(sample.orientation_var, noise.attitude, use_reported)


@kernel
def _floor_variance(variance, noise, use_reported):
    reported = use_reported and np.isfinite(variance[0]) and np.isfinite(variance[1]) and np.isfinite(variance[2])
    for axis in range(3):
        variance[axis] = max(noise * noise, variance[axis]) if reported else noise * noise
