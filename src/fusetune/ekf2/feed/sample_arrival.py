"""Hand the samples that arrived with one IMU sample to the buffers, and take those due at the fusion time horizon.

`receive_…` runs when a sample arrives; `pop_…` when the horizon moves. `inputs` is the named tuple of sample arrays
that `fusetune.ekf2.feed.inputs` builds. After a `pop_…`, `ekf.<sensor>_data_ready` says whether a sample was due, and
`ekf.<sensor>_sample` holds it. `ekf.<sensor>_newest_time_us` is the IMU time at which a sample last arrived.
What parameters say of a sample's noise or mounting is what they said when it arrived.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.buffers import find_newest_due, offer, take


@kernel
def receive_gnss(ekf, params, inputs, slot):
    """Buffer a GNSS sample; note when one with a heading came."""
    ring = ekf.buffers.gnss
    if offer(ekf, ring, inputs.gnss[slot].time_us, params.EKF2_GPS_DELAY, slot):
        ekf.buffers.gnss_yaw_offset[ring.head] = params.EKF2_GPS_YAW_OFF
        ekf.gnss_newest_time_us = ekf.time_latest_us
        if np.isfinite(inputs.gnss[slot].yaw):
            ekf.gnss_yaw_newest_time_us = ekf.time_latest_us
    ekf.gnss_buffer_exists = True


@kernel
def receive_mag(ekf, params, inputs, slot):
    """Buffer a magnetometer sample."""
    if offer(ekf, ekf.buffers.mag, inputs.mag[slot].time_us, params.EKF2_MAG_DELAY, slot):
        ekf.mag_newest_time_us = ekf.time_latest_us
    ekf.mag_buffer_exists = True


@kernel
def receive_baro(ekf, params, inputs, slot):
    """Buffer a barometer sample; its air density counts at once."""
    ekf.air_density = inputs.air_density[slot]
    if offer(ekf, ekf.buffers.baro, inputs.baro[slot].time_us, params.EKF2_BARO_DELAY, slot):
        ekf.baro_newest_time_us = ekf.time_latest_us
    ekf.baro_buffer_exists = True


@kernel
def receive_range(ekf, params, inputs, slot):
    """Buffer a range sample; the sensor's limits count at once."""
    if offer(ekf, ekf.buffers.range, inputs.range[slot].time_us, params.EKF2_RNG_DELAY, slot):
        ekf.range_newest_time_us = ekf.time_latest_us
    ekf.range_buffer_exists = True
    ekf.range.sensor_min_distance = inputs.range_limits[slot, 0]
    ekf.range.sensor_max_distance = inputs.range_limits[slot, 1]


@kernel
def receive_flow(ekf, params, inputs, slot):
    """Buffer an optical flow sample; the sensor's limits count at once."""
    ekf.flow.max_rate = inputs.flow_limits[slot, 0]
    ekf.flow.min_distance = inputs.flow_limits[slot, 1]
    ekf.flow.max_distance = inputs.flow_limits[slot, 2]
    if offer(ekf, ekf.buffers.flow, inputs.flow[slot].time_us, params.EKF2_OF_DELAY, slot):
        ekf.flow_newest_time_us = ekf.time_latest_us
    ekf.flow_buffer_exists = True


@kernel
def receive_ev(ekf, params, inputs, slot):
    """Buffer an external vision sample."""
    ring = ekf.buffers.ev
    if offer(ekf, ring, inputs.ev[slot].time_us, params.EKF2_EV_DELAY, slot):
        noise = ekf.buffers.ev_noise[ring.head]
        noise.position = params.EKF2_EVP_NOISE
        noise.velocity = params.EKF2_EVV_NOISE
        noise.attitude = params.EKF2_EVA_NOISE
        noise.mode = int(params.EKF2_EV_NOISE_MD)
        ekf.ev_newest_time_us = ekf.time_latest_us
        ekf.ev.time_last_buffer_push_us = ekf.time_latest_us
        ekf.ev.newest_quality = inputs.ev[slot].quality
    ekf.ev_buffer_exists = True


@kernel
def receive_airspeed(ekf, params, inputs, slot):
    """Buffer an airspeed sample."""
    if offer(ekf, ekf.buffers.airspeed, inputs.airspeed[slot].time_us, params.EKF2_ASP_DELAY, slot):
        ekf.airspeed_newest_time_us = ekf.time_latest_us
    ekf.airspeed_buffer_exists = True


@kernel
def receive_auxvel(ekf, params, inputs, slot):
    """Buffer an auxiliary velocity sample."""
    if offer(ekf, ekf.buffers.auxvel, inputs.auxvel[slot].time_us, params.EKF2_AVEL_DELAY, slot):
        ekf.auxvel_newest_time_us = ekf.time_latest_us
    ekf.auxvel_buffer_exists = True


@kernel
def receive_system_flags(ekf, inputs, slot):
    """Buffer a change of the vehicle's state."""
    offer(ekf, ekf.buffers.system_flags, inputs.system_flags[slot].time_us, 0.0, slot)
    ekf.system_flags_buffer_exists = True


@kernel
def pop_gnss(ekf, inputs):
    """Take the GNSS sample that is due."""
    ring = ekf.buffers.gnss
    index = find_newest_due(ring, ekf.time_delayed_us)
    ekf.gnss_data_ready = index >= 0
    if index >= 0:
        ekf.gnss_sample = inputs.gnss[ring.slot[index]]
        ekf.gnss_sample.time_us = ring.time_us[index]
        _apply_antenna_yaw_offset(ekf.gnss_sample, ekf.buffers.gnss_yaw_offset[index])
        take(ring, index)


@kernel
def _apply_antenna_yaw_offset(sample, offset_deg):
    """Use EKF2_GPS_YAW_OFF where the receiver reports a heading but no offset of its own."""
    offset = np.deg2rad(offset_deg)
    if abs(offset) > 0.0 and not np.isfinite(sample.yaw_offset) and np.isfinite(sample.yaw):
        offset = np.arctan2(np.sin(offset), np.cos(offset))
        sample.yaw_offset = offset
        sample.yaw = np.arctan2(np.sin(sample.yaw - offset), np.cos(sample.yaw - offset))


@kernel
def pop_mag(ekf, inputs):
    """Take the magnetometer sample that is due."""
    ring = ekf.buffers.mag
    index = find_newest_due(ring, ekf.time_delayed_us)
    ekf.mag_data_ready = index >= 0
    if index >= 0:
        ekf.mag_sample = inputs.mag[ring.slot[index]]
        ekf.mag_sample.time_us = ring.time_us[index]
        take(ring, index)


@kernel
def pop_baro(ekf, inputs):
    """Take the barometer sample that is due."""
    ring = ekf.buffers.baro
    index = find_newest_due(ring, ekf.time_delayed_us)
    ekf.baro_data_ready = index >= 0
    if index >= 0:
        ekf.baro_sample = inputs.baro[ring.slot[index]]
        ekf.baro_sample.time_us = ring.time_us[index]
        take(ring, index)


@kernel
def pop_range(ekf, inputs):
    """Take the range sample that is due."""
    ring = ekf.buffers.range
    index = find_newest_due(ring, ekf.time_delayed_us)
    ekf.range_data_ready = index >= 0
    if index >= 0:
        ekf.range_sample = inputs.range[ring.slot[index]]
        ekf.range_sample.time_us = ring.time_us[index]
        take(ring, index)


@kernel
def pop_flow(ekf, inputs):
    """Take the optical flow sample that is due."""
    ring = ekf.buffers.flow
    index = find_newest_due(ring, ekf.time_delayed_us)
    ekf.flow_data_ready = index >= 0
    if index >= 0:
        ekf.flow_sample = inputs.flow[ring.slot[index]]
        ekf.flow_sample.time_us = ring.time_us[index]
        take(ring, index)


@kernel
def pop_ev(ekf, inputs):
    """Take the external vision sample that is due."""
    ring = ekf.buffers.ev
    index = find_newest_due(ring, ekf.time_delayed_us)
    ekf.ev_data_ready = index >= 0
    if index >= 0:
        ekf.ev_sample = inputs.ev[ring.slot[index]]
        ekf.ev_sample.time_us = ring.time_us[index]
        _apply_vision_noise(ekf.ev_sample, ekf.buffers.ev_noise[index])
        take(ring, index)


@kernel
def _apply_vision_noise(sample, noise):
    """Replace the variances by the noise parameters, or floor them, as EKF2_EV_NOISE_MD asks."""
    use_reported = noise.mode == 0
    _floor_variance(sample.position_var, noise.position, use_reported)
    _floor_variance(sample.velocity_var, noise.velocity, use_reported)
    _floor_variance(sample.orientation_var, noise.attitude, use_reported)


@kernel
def _floor_variance(variance, noise, use_reported):
    reported = use_reported and np.isfinite(variance[0]) and np.isfinite(variance[1]) and np.isfinite(variance[2])
    for axis in range(3):
        variance[axis] = max(noise * noise, variance[axis]) if reported else noise * noise


@kernel
def pop_airspeed(ekf, inputs):
    """Take the airspeed sample that is due."""
    ring = ekf.buffers.airspeed
    index = find_newest_due(ring, ekf.time_delayed_us)
    ekf.airspeed_data_ready = index >= 0
    if index >= 0:
        ekf.airspeed_sample = inputs.airspeed[ring.slot[index]]
        ekf.airspeed_sample.time_us = ring.time_us[index]
        take(ring, index)


@kernel
def pop_auxvel(ekf, inputs):
    """Take the auxiliary velocity sample that is due."""
    ring = ekf.buffers.auxvel
    index = find_newest_due(ring, ekf.time_delayed_us)
    ekf.auxvel_data_ready = index >= 0
    if index >= 0:
        ekf.auxvel_sample = inputs.auxvel[ring.slot[index]]
        ekf.auxvel_sample.time_us = ring.time_us[index]
        take(ring, index)


@kernel
def pop_drag(ekf):
    """Take the specific-force sample that is due."""
    drag = ekf.buffers.drag
    index = find_newest_due(drag.ring, ekf.time_delayed_us)
    ekf.drag_data_ready = index >= 0
    if index >= 0:
        ekf.drag_sample = drag.sample[drag.ring.slot[index]]
        take(drag.ring, index)


@kernel
def pop_system_flags(ekf, inputs):
    """Take the change of the vehicle's state that is due."""
    ring = ekf.buffers.system_flags
    index = find_newest_due(ring, ekf.time_delayed_us)
    ekf.system_flags_data_ready = index >= 0
    if index >= 0:
        ekf.system_flags_sample = inputs.system_flags[ring.slot[index]]
        take(ring, index)
