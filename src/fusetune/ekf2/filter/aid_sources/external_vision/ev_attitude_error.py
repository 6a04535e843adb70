"""Filtered rotation from the frame of external vision to NED.

Mirrors `updateEvAttitudeErrorFilter` of PX4 v1.16 `EKF/aid_sources/external_vision/ev_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.numerics.rotations import (
    quat_multiply,
    quat_normalise,
    quat_to_dcm,
    quat_to_rotation_vector,
    rotation_vector_to_quat,
)
from fusetune.ekf2.releases.by_release import by_release

FILTER_INTERVAL_S = 0.01
FILTER_TIME_CONSTANT_S = 10.0
FILTER_ALPHA = FILTER_INTERVAL_S / (FILTER_INTERVAL_S + FILTER_TIME_CONSTANT_S)
"""PX4 sets the gain once, from the nominal update interval."""


OLD_FILTER_ALPHA = 0.001


@kernel
def _gain_by_time_constant(ekf):
    return FILTER_ALPHA


@kernel
def _gain_as_given(ekf):
    return OLD_FILTER_ALPHA


_filter_gain = by_release(_gain_by_time_constant, "rounds_vision_filter", _gain_as_given)


@kernel
def update_ev_attitude_error_filter(ekf, ev_reset):
    """Filter the rotation between the vision attitude and the estimate; restart it when vision was reset."""
    error = ekf.scratch.quat_error
    quat = ekf.sensors.ev.sample.quat
    error[0], error[1], error[2], error[3] = quat[0], -quat[1], -quat[2], -quat[3]
    quat_multiply(ekf.q, error, error)
    quat_normalise(error)
    for i in range(4):
        if not math.isfinite(error[i]):
            return
    if not ekf.ev.q_error_initialized or ev_reset:
        for i in range(4):
            ekf.ev.q_error_filt[i] = error[i]
        ekf.ev.q_error_initialized = True
    else:
        _step_towards(ekf.ev.q_error_filt, error, ekf.scratch.quat_before, _filter_gain(ekf))


@kernel
def _step_towards(q, target, work, alpha):
    """Turn `q` by the fraction `alpha` of the shortest rotation to `target`."""
    work[0], work[1], work[2], work[3] = q[0], -q[1], -q[2], -q[3]
    quat_multiply(work, target, work)
    if work[0] < 0.0:
        for i in range(4):
            work[i] = -work[i]
    x, y, z = quat_to_rotation_vector(work)
    work[0], work[1], work[2], work[3] = rotation_vector_to_quat(alpha * x, alpha * y, alpha * z)
    quat_multiply(q, work, q)


@kernel
def _larger_variance(ekf, axis, variance, axes):
    orientation_var = ekf.sensors.ev.sample.orientation_var
    for i in range(axes):
        variance = max(variance, orientation_var[i])
    return variance


@kernel
def _levered_variance(ekf, axis, variance, axes):
    """An attitude error turns the position about the origin of vision: each axis feels the two others."""
    sample = ekf.sensors.ev.sample
    j, k = (axis + 1) % 3, (axis + 2) % 3
    return variance + sample.pos[j] ** 2 * sample.orientation_var[k] + sample.pos[k] ** 2 * sample.orientation_var[j]


variance_with_attitude = by_release(_larger_variance, "levers_vision_attitude", _levered_variance)
"""Variance (m²) of one axis of the position where its uncertain attitude, of the first so many axes, counts, too."""


@kernel
def _refresh_filtered_rotation(ekf):
    quat_to_dcm(ekf.ev.q_error_filt, ekf.ev.R_ev_to_ekf)


@kernel
def _refresh_rotation_of_sample(ekf):
    error, quat = ekf.scratch.quat_error, ekf.sensors.ev.sample.quat
    error[0], error[1], error[2], error[3] = quat[0], -quat[1], -quat[2], -quat[3]
    quat_multiply(ekf.q, error, error)
    quat_normalise(error)
    quat_to_dcm(error, ekf.ev.R_ev_to_ekf)


refresh_ev_rotation = by_release(
    _refresh_filtered_rotation, "takes_vision_rotation_unfiltered", _refresh_rotation_of_sample
)
"""Write the matrix of the rotation from the vision frame to NED into `ekf.ev.R_ev_to_ekf`."""
