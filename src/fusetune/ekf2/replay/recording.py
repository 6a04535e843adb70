"""What a replay keeps: innovations, states, published position and flags, as PX4's estimator topics hold them.

An aid source is recorded whenever it has a new `timestamp_sample` after an update, like `estimator_aid_src_*`; states
and position at every update; flags when they change, and once a second.
"""

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common import state as S
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE, AID_SOURCE_AXES, AID_SOURCE_NAMES
from fusetune.ekf2.filter.common.conditions import (
    is_local_horizontal_position_valid,
    is_local_vertical_position_valid,
    is_local_vertical_velocity_valid,
)
from fusetune.ekf2.filter.common.control_status import CONTROL_STATUS_NAMES, FAULT_STATUS_NAMES, REJECTION_NAMES
from fusetune.ekf2.filter.common.local_origin import origin_altitude, project_to_local
from fusetune.ekf2.numerics.geodesy import add_to_lat_lon
from fusetune.ekf2.numerics.rotations import rotate_to_earth

INNOVATION_ROW = np.dtype(
    [
        ("source", "i4"),
        ("axis", "i4"),
        ("timestamp_sample", "i8"),
        ("observation", "f4"),
        ("observation_variance", "f4"),
        ("innovation", "f4"),
        ("innovation_variance", "f4"),
        ("test_ratio", "f4"),
        ("innovation_rejected", "?"),
        ("fused", "?"),
    ],
    align=True,
)

STATE_ROW = np.dtype(
    [
        ("timestamp", "i8"),
        ("timestamp_sample", "i8"),
        ("states", "f4", (S.PUBLISHED_STATE_SIZE,)),
        ("covariances", "f4", (S.ERROR_STATE_SIZE,)),
        ("delta_angle", "f4", (3,)),
        ("delta_angle_dt", "f4"),
        ("delta_velocity", "f4", (3,)),
        ("delta_velocity_dt", "f4"),
    ],
    align=True,
)
"""`delta_angle` (rad, body) to `delta_velocity_dt` are the down-sampled IMU interval, dt in s, over which the state was
predicted before it was corrected to what stands here."""

SCORED_STATE_ROW = np.dtype(
    [
        ("timestamp_sample", "i8"),
        ("quaternion", "f4", (4,)),
        ("velocity", "f4", (3,)),
        ("attitude_variance", "f4", (3,)),
        ("velocity_variance", "f4", (3,)),
        ("position_variance", "f4", (3,)),
    ],
    align=True,
)
"""What scores read of a STATE_ROW."""

LOCAL_POSITION_ROW = np.dtype(
    [
        ("timestamp", "i8"),
        ("timestamp_sample", "i8"),
        ("x", "f4"),
        ("y", "f4"),
        ("z", "f4"),
        ("vx", "f4"),
        ("vy", "f4"),
        ("vz", "f4"),
        ("heading", "f4"),
        ("eph", "f4"),
        ("epv", "f4"),
        ("xy_reset_counter", "i4"),
        ("z_reset_counter", "i4"),
        ("vxy_reset_counter", "i4"),
        ("vz_reset_counter", "i4"),
        ("heading_reset_counter", "i4"),
        ("xy_valid", "?"),
        ("z_valid", "?"),
        ("q", "f4", (4,)),
    ],
    align=True,
)
"""`q` is the output predictor's attitude, which the vehicle publishes as `vehicle_attitude`."""

FLAG_COLUMNS = (
    tuple(f"cs_{name}" for name in CONTROL_STATUS_NAMES)
    + tuple(f"fs_{name}" for name in FAULT_STATUS_NAMES)
    + tuple(f"reject_{name}" for name in REJECTION_NAMES)
)

FLAGS_ROW = np.dtype([("timestamp", "i8"), ("flags", "u1", (len(FLAG_COLUMNS),))], align=True)

FLAGS_INTERVAL_US = 1_000_000
MAX_ROWS_PER_UPDATE = sum(AID_SOURCE_AXES.values())
SOURCE_AXES = np.array([AID_SOURCE_AXES[name] for name in AID_SOURCE_NAMES])

RECORDER_MEMORY = np.dtype(
    [
        ("innovation_rows", "i8"),
        ("update_rows", "i8"),
        ("flag_rows", "i8"),
        ("updates", "i8"),
        ("last_sample", "i8", (len(AID_SOURCE_NAMES),)),
        ("last_flags", FLAGS_ROW),
    ],
    align=True,
)


class Recording(Enum):
    """How much is kept of a replay."""

    FULL = "full"
    """Everything."""
    SCORING = "scoring"
    """What scores are made of, the same figures: innovations and flags; of the states SCORED_STATE_ROW; of the local
    position the first and the last row, and around every step of a reset counter the row of the step and the two
    before it."""


FULL, SCORING = Recording


class RecordArrays(NamedTuple):
    """Rows of one stretch of a replay."""

    innovations: np.ndarray
    states: np.ndarray
    local_position: np.ndarray
    flags: np.ndarray


class EstimatorViews(NamedTuple):
    """Parts of the estimator's record seen as plain arrays over the same memory."""

    aids: np.ndarray
    """One AID_SOURCE per source."""
    axes: np.ndarray
    """Number of axes of each."""
    cs: np.ndarray
    fs: np.ndarray
    reject: np.ndarray


def views_of(ekf: np.ndarray) -> EstimatorViews:
    """Views into a one-element array of the estimator's record."""
    return EstimatorViews(
        aids=ekf["aid"].view(AID_SOURCE).reshape(-1),
        axes=SOURCE_AXES,
        cs=ekf["cs"].view(np.uint8).reshape(-1),
        fs=ekf["fs"].view(np.uint8).reshape(-1),
        reject=ekf["reject"].view(np.uint8).reshape(-1),
    )


def allocate_records(updates: int) -> RecordArrays:
    """Room for as many updates, whatever they publish."""
    return RecordArrays(
        _zero_rows(updates * MAX_ROWS_PER_UPDATE, INNOVATION_ROW),
        _zero_rows(updates, STATE_ROW),
        _zero_rows(updates, LOCAL_POSITION_ROW),
        _zero_rows(updates, FLAGS_ROW),
    )


def _zero_rows(count: int, dtype: np.dtype) -> np.ndarray:
    """Rows of zeros by way of bytes, which the operating system provides on first use instead of NumPy at once."""
    return np.zeros(count * dtype.itemsize, np.uint8).view(dtype)


def joined(parts: Sequence[RecordArrays]) -> RecordArrays:
    """Rows of several stretches, one after the other."""
    dtypes = [rows.dtype for rows in parts[0]] if parts else (INNOVATION_ROW, STATE_ROW, LOCAL_POSITION_ROW, FLAGS_ROW)
    return RecordArrays(*(joined_rows([part[i] for part in parts], dtype) for i, dtype in enumerate(dtypes)))


def joined_rows(parts: list[np.ndarray], dtype: np.dtype) -> np.ndarray:
    """Rows of several parts in one array, copied as bytes and not field by field."""
    whole = _zero_rows(sum(map(len, parts)), dtype)
    np.concatenate([part.view(np.uint8) for part in parts] or [whole.view(np.uint8)], out=whole.view(np.uint8))
    return whole


def with_fields(rows: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """Some fields of rows, in an array that holds no others."""
    kept = np.empty(len(rows), np.dtype([(name, rows.dtype[name]) for name in names], align=True))
    for name in names:
        kept[name] = rows[name]
    return kept


@kernel
def record_update(ekf, params, views, recorder, records, timestamp):
    """Keep what one filter update published."""
    aids = views.aids
    for source in range(len(aids)):
        if aids[source].timestamp_sample > recorder.last_sample[source]:
            recorder.last_sample[source] = aids[source].timestamp_sample
            _record_innovations(aids[source], source, views.axes[source], recorder, records.innovations)
    row = recorder.update_rows
    _record_states(ekf, records.states[row], timestamp)
    _record_local_position(ekf, params, records.local_position[row], timestamp)
    recorder.update_rows = row + 1
    recorder.updates += 1
    _record_flags(views, recorder, records.flags, timestamp)


@kernel
def _record_innovations(aid, source, axes, recorder, rows):
    for axis in range(axes):
        row = rows[recorder.innovation_rows]
        row.source = source
        row.axis = axis
        row.timestamp_sample = aid.timestamp_sample
        row.observation = aid.observation[axis]
        row.observation_variance = aid.observation_variance[axis]
        row.innovation = aid.innovation[axis]
        row.innovation_variance = aid.innovation_variance[axis]
        row.test_ratio = aid.test_ratio[axis]
        row.innovation_rejected = aid.innovation_rejected
        row.fused = aid.fused
        recorder.innovation_rows += 1


@kernel
def _record_states(ekf, row, timestamp):
    row.timestamp = timestamp
    row.timestamp_sample = ekf.time_delayed_us
    states = row.states
    for i in range(4):
        states[S.PUBLISHED_QUATERNION + i] = ekf.q[i]
    for i in range(3):
        states[S.PUBLISHED_VELOCITY + i] = ekf.vel[i]
        states[S.PUBLISHED_GYRO_BIAS + i] = ekf.gyro_bias[i]
        states[S.PUBLISHED_ACCEL_BIAS + i] = ekf.accel_bias[i]
        states[S.PUBLISHED_MAG_EARTH + i] = ekf.mag_I[i]
        states[S.PUBLISHED_MAG_BODY + i] = ekf.mag_B[i]
    states[S.PUBLISHED_POSITION + 2] = -ekf.gpos_alt
    states[S.PUBLISHED_WIND] = ekf.wind_vel[0]
    states[S.PUBLISHED_WIND + 1] = ekf.wind_vel[1]
    states[S.PUBLISHED_TERRAIN] = ekf.terrain
    for i in range(S.ERROR_STATE_SIZE):
        row.covariances[i] = ekf.P[i, i]
    imu = ekf.imu_delayed
    for i in range(3):
        row.delta_angle[i] = imu.delta_ang[i]
        row.delta_velocity[i] = imu.delta_vel[i]
    row.delta_angle_dt = imu.delta_ang_dt
    row.delta_velocity_dt = imu.delta_vel_dt


@kernel
def _record_local_position(ekf, params, row, timestamp):
    """Position and velocity of the body's origin: the predictor's, which are the IMU's, less its lever arm."""
    output = ekf.output
    offset_n, offset_e, offset_d = rotate_to_earth(
        output.R_to_earth, params.EKF2_IMU_POS_X, params.EKF2_IMU_POS_Y, params.EKF2_IMU_POS_Z
    )
    newest = output.newest
    lat, lon = add_to_lat_lon(
        output.ref_lat, output.ref_lon, output.ref_alt, newest.pos[0] - offset_n, newest.pos[1] - offset_e
    )
    x, y = project_to_local(ekf, lat, lon)
    row.timestamp = timestamp
    row.timestamp_sample = timestamp
    row.x = x
    row.y = y
    row.z = newest.pos[2] - offset_d - output.ref_alt + origin_altitude(ekf)
    row.vx = newest.vel[0] - output.vel_imu_rel_body[0]
    row.vy = newest.vel[1] - output.vel_imu_rel_body[1]
    row.vz = newest.vel[2] - output.vel_imu_rel_body[2]
    q = newest.q
    row.heading = np.arctan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]))
    row.eph = _horizontal_accuracy(ekf)
    row.epv = np.sqrt(ekf.P[S.POSITION + 2, S.POSITION + 2])
    for i in range(4):
        row.q[i] = q[i]
    reset = ekf.state_reset
    row.xy_reset_counter = reset.pos_ne_counter
    row.z_reset_counter = reset.pos_d_counter
    row.vxy_reset_counter = reset.vel_ne_counter
    row.vz_reset_counter = reset.vel_d_counter
    row.heading_reset_counter = reset.quat_counter
    row.xy_valid = is_local_horizontal_position_valid(ekf)
    row.z_valid = is_local_vertical_position_valid(ekf) or is_local_vertical_velocity_valid(ekf)


@kernel
def _horizontal_accuracy(ekf):
    """Standard deviation of the horizontal position (m); after long dead reckoning at least the last innovation."""
    accuracy = np.sqrt(ekf.P[S.POSITION, S.POSITION] + ekf.P[S.POSITION + 1, S.POSITION + 1])
    if ekf.horizontal_deadreckon_time_exceeded:
        if ekf.cs.gnss_pos:
            innovation = ekf.aid.gnss_pos.innovation
            accuracy = max(accuracy, np.hypot(innovation[0], innovation[1]))
        if ekf.cs.ev_pos:
            innovation = ekf.aid.ev_pos.innovation
            accuracy = max(accuracy, np.hypot(innovation[0], innovation[1]))
    return accuracy


@kernel
def _record_flags(views, recorder, rows, timestamp):
    """Keep the flags if any changed since they were last kept, or a second has passed."""
    last = recorder.last_flags
    differences, column = 0, 0
    for group in (views.cs, views.fs, views.reject):
        for i in range(len(group)):
            differences += group[i] != last.flags[column + i]
        column += len(group)
    if differences == 0 and timestamp < last.timestamp + FLAGS_INTERVAL_US:
        return
    column = 0
    for group in (views.cs, views.fs, views.reject):
        for i in range(len(group)):
            last.flags[column + i] = group[i]
        column += len(group)
    last.timestamp = timestamp
    rows[recorder.flag_rows] = last
    recorder.flag_rows += 1
