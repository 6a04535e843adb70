"""What a replay keeps: innovations, states, published position and flags, as PX4's estimator topics hold them.

An aid source is recorded whenever it has a new `timestamp_sample` after an update, like `estimator_aid_src_*`; states
and position at every update; flags when they change, and once a second.
"""

import math
import threading
from collections.abc import Sequence
from enum import Enum
from functools import cache
from typing import NamedTuple

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.common import state as S
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE, AID_SOURCE_AXES, AID_SOURCE_NAMES
from fusetune.ekf2.filter.common.conditions import (
    is_local_horizontal_position_valid,
    is_local_vertical_position_valid,
    is_local_vertical_velocity_valid,
)
from fusetune.ekf2.filter.common.control_status import CONTROL_STATUS_NAMES, FAULT_STATUS_NAMES, REJECTION_NAMES
from fusetune.ekf2.filter.common.local_origin import altitude_at_origin
from fusetune.ekf2.filter.quaternion_core.core_memory import Q3
from fusetune.ekf2.filter.quaternion_core.quaternion_covariance import attitude_variance_about
from fusetune.ekf2.filter.vertical_innovations import GNSS_VELOCITY, VISION_VELOCITY
from fusetune.ekf2.numerics.geodesy import metres_per_radian, project_about
from fusetune.ekf2.numerics.rotations import rotate_to_earth, wrap_pi
from fusetune.ekf2.releases.by_release import by_release

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

N_CONTROL, N_FAULT, N_REJECTION = len(CONTROL_STATUS_NAMES), len(FAULT_STATUS_NAMES), len(REJECTION_NAMES)

FLAGS_ROW = np.dtype([("timestamp", "i8"), ("flags", "u1", (len(FLAG_COLUMNS),))], align=True)

FLAGS_INTERVAL_US = 1_000_000
MAX_ROWS_PER_UPDATE = sum(AID_SOURCE_AXES.values())
SOURCE_AXES = np.array([AID_SOURCE_AXES[name] for name in AID_SOURCE_NAMES])
SINGLE_PRECISION_LIMIT = 2.0**128 - 2.0**103
"""What is not below it becomes infinite in single precision."""

PUBLISHED = np.dtype(
    [
        ("timestamp", "i8"),
        *fields("f8", "pos", "vel", shape=(3,)),
        ("q", "f8", (4,)),
        *fields("f8", "ref_lat", "ref_lon", "ref_alt", "origin_lat", "origin_lon", "origin_alt", "eph", "epv"),
        *fields(
            "i8",
            "xy_reset_counter",
            "z_reset_counter",
            "vxy_reset_counter",
            "vz_reset_counter",
            "heading_reset_counter",
        ),
        *fields("?", "xy_valid", "z_valid", "is_kept"),
    ],
    align=True,
)
"""What a LOCAL_POSITION_ROW is made of, before the projection; positions are m from a global reference (rad, m)."""

PROJECTION = np.dtype(
    [*fields("f8", "ref_lat", "ref_alt", "metres_north", "metres_east", "origin_lat", "sin_origin", "cos_origin")],
    align=True,
)
"""What the projection needs of the reference and of the origin, which change at resets only."""

PUBLISHED_KEPT = 3

RECORDER_MEMORY = np.dtype(
    [
        *fields("i8", "mode", "sources"),
        *fields("i8", "innovation_rows", "state_rows", "position_rows", "flag_rows", "updates"),
        ("last_sample", "i8", (len(AID_SOURCE_NAMES),)),
        ("last_flags", FLAGS_ROW),
        ("published", PUBLISHED, (PUBLISHED_KEPT,)),
        ("projection", PROJECTION),
        ("diverged", "?"),
    ],
    align=True,
)
"""What the recorder knows between two updates; `published` holds that of the last three in turn, `sources` a bit for
each aid source that is recorded."""

IS_FULL, IS_SCORING, IS_GAP, IS_TRACED = range(4)
"""What `mode` says: everything is kept, or what scores need, or of that what is told of a gap, or scores and all of the
local position."""


class Recording(Enum):
    """How much is kept of a replay."""

    FULL = "full"
    """Everything."""
    SCORING = "scoring"
    """What scores are made of, the same figures: innovations and flags; of the states SCORED_STATE_ROW; of the local
    position the first and the last row, and around every step of a reset counter the row of the step and the two
    before it."""
    TRACED = "traced"
    """As SCORING, but of the local position every row: errors against a reference are told of them."""


FULL, SCORING, TRACED = Recording


class RecordArrays(NamedTuple):
    """Rows of one stretch of a replay."""

    innovations: np.ndarray
    states: np.ndarray
    local_position: np.ndarray
    flags: np.ndarray


class RecordRoom(NamedTuple):
    """Room for the rows of one stretch."""

    innovations: np.ndarray
    states: np.ndarray
    local_position: np.ndarray
    flags: np.ndarray
    scored_states: np.ndarray


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


ALL_SOURCES = (1 << len(AID_SOURCE_NAMES)) - 1


def new_recorder(mode: int) -> np.ndarray:
    """A recorder that has seen nothing, of all sources."""
    recorder = np.zeros(1, RECORDER_MEMORY)
    recorder["mode"], recorder["sources"] = mode, ALL_SOURCES
    # there is nothing of before the first update that could be kept
    recorder["published"]["is_kept"] = True
    return recorder


def allocate_records(updates: int, mode: int) -> RecordRoom:
    """Room for as many updates, whatever they publish.

    Rows of states, and where all are recorded those of the position, are the caller's. The others lie where the next
    call of this thread for the same kind of recording puts its own: to ask the system for them anew takes longer than
    to fill them.
    """
    # a step has two rows before it, which may be of the stretch before; the last row may come after a step
    positions = updates + PUBLISHED_KEPT
    return RecordRoom(
        _shared_room(updates * MAX_ROWS_PER_UPDATE, INNOVATION_ROW, mode == IS_GAP),
        _zero_rows(updates if mode == IS_FULL else 0, STATE_ROW),
        _zero_rows(positions, LOCAL_POSITION_ROW)
        if mode in (IS_FULL, IS_TRACED)
        else _shared_room(positions, LOCAL_POSITION_ROW, mode == IS_GAP),
        _shared_room(updates, FLAGS_ROW, mode == IS_GAP),
        _zero_rows(updates if mode in (IS_SCORING, IS_TRACED) else 0, SCORED_STATE_ROW),
    )


_rooms = threading.local()


def _shared_room(count: int, row: np.dtype, of_gaps: bool) -> np.ndarray:
    """Rows that hold whatever this thread left there; only what is touched takes memory."""
    rooms = _rooms.__dict__.setdefault("by_kind", {})
    room = rooms.get((row, of_gaps))
    if room is None or len(room) < count:
        room = rooms[row, of_gaps] = np.empty(count, row)
    return room[:count]


def copied(rows: np.ndarray) -> np.ndarray:
    """A copy of rows out of the room for them; what lies between their fields, whatever it was, is zero."""
    whole = copied_bytes(rows)
    for first, last in _paddings(rows.dtype):
        whole.view(np.uint8).reshape(-1, rows.dtype.itemsize)[:, first:last] = 0
    return whole


def copied_bytes(rows: np.ndarray) -> np.ndarray:
    """A copy of contiguous rows at once, not field by field."""
    return rows.view(np.uint8).copy().view(rows.dtype)


@cache
def _paddings(row: np.dtype) -> list[tuple[int, int]]:
    """The bytes of a row that belong to no field."""
    fields_of = [row.fields[name][:2] for name in row.names or ()] if row.fields else []
    ends = [0, *(offset + kind.itemsize for kind, offset in fields_of)]
    starts = [*(offset for _, offset in fields_of), row.itemsize]
    return [(end, start) for end, start in zip(ends, starts, strict=True) if start > end]


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
    """Keep what one filter update published, as much of it as the recorder's mode asks for."""
    aids = views.aids
    for source in range(len(aids)):
        if aids[source].timestamp_sample > recorder.last_sample[source]:
            recorder.last_sample[source] = aids[source].timestamp_sample
            if (recorder.sources >> source) & 1:
                _record_innovations(aids[source], source, views.axes[source], recorder, records.innovations)
                _tell_vertical_apart(ekf, source, recorder, records.innovations)
    if recorder.mode == IS_GAP:
        if recorder.updates == 0:
            _note_published(ekf, params, recorder.published[0], timestamp)
            _record_position(ekf, recorder.published[0], recorder, records.local_position)
        recorder.updates += 1
        return
    now = recorder.published[recorder.updates % PUBLISHED_KEPT]
    _note_published(ekf, params, now, timestamp)
    if recorder.mode == IS_FULL:
        _record_states(ekf, records.states[recorder.state_rows], timestamp)
        _record_position(ekf, now, recorder, records.local_position)
    else:
        _record_scored_states(ekf, records.scored_states[recorder.state_rows])
        if recorder.mode == IS_TRACED:
            _record_position(ekf, now, recorder, records.local_position)
        else:
            _record_position_of_steps(ekf, recorder, records.local_position)
    recorder.state_rows += 1
    recorder.diverged |= not _is_finite(ekf)
    _record_flags(views, recorder, records.flags, timestamp)
    recorder.updates += 1


@kernel
def begin_gap_recording(recorder, sources):
    """Keep innovations of some aid sources, one bit each, and the first and the last row of the local position."""
    recorder.mode = IS_GAP
    recorder.sources = sources
    recorder.updates = 0


@kernel
def finish_recording(ekf, params, recorder, records):
    """Keep the last row of the local position, if it was not."""
    if recorder.mode == IS_GAP:
        if recorder.updates > 1:
            _note_published(ekf, params, recorder.published[0], ekf.time_latest_us)
            _record_position(ekf, recorder.published[0], recorder, records.local_position)
    elif recorder.updates > 0:
        last = recorder.published[(recorder.updates - 1) % PUBLISHED_KEPT]
        if not last.is_kept:
            _record_position(ekf, last, recorder, records.local_position)


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
def _judged_together(ekf, source, recorder, rows):
    """Since v1.14 all axes of a source are fused, or none."""


@kernel
def _judged_apart(ekf, source, recorder, rows):
    """The last axis of a velocity, just recorded, was judged by itself."""
    row, vertical = rows[recorder.innovation_rows - 1], ekf.vertical
    if source == GNSS_VELOCITY:
        row.innovation_rejected, row.fused = vertical.gnss_rejected, vertical.gnss_fused
    elif source == VISION_VELOCITY:
        row.innovation_rejected, row.fused = vertical.ev_rejected, vertical.ev_fused


_tell_vertical_apart = by_release(_judged_together, "aids_gnss_by_mask", _judged_apart)


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
    _record_position_states(ekf, states)
    states[S.PUBLISHED_WIND] = ekf.wind_vel[0]
    states[S.PUBLISHED_WIND + 1] = ekf.wind_vel[1]
    states[S.PUBLISHED_TERRAIN] = ekf.terrain
    _record_variances(ekf, row.covariances)
    imu = ekf.imu_delayed
    for i in range(3):
        row.delta_angle[i] = imu.delta_ang[i]
        row.delta_velocity[i] = imu.delta_vel[i]
    row.delta_angle_dt = imu.delta_ang_dt
    row.delta_velocity_dt = imu.delta_vel_dt


@kernel
def _record_diagonal(ekf, variances):
    for i in range(S.ERROR_STATE_SIZE):
        variances[i] = ekf.P[i, i]


@kernel
def _record_quaternion_first(ekf, variances):
    """The order of PX4 v1.14: all four of the quaternion, then the others."""
    for i in range(S.VELOCITY):
        variances[i] = ekf.P[i, i]
    variances[S.VELOCITY] = ekf.P[Q3, Q3]
    for i in range(S.VELOCITY, Q3):
        variances[i + 1] = ekf.P[i, i]


_record_variances = by_release(_record_diagonal, "adds_quaternion_errors", _record_quaternion_first)


@kernel
def _error_variance(ekf, axis):
    return ekf.P[S.ATTITUDE + axis, S.ATTITUDE + axis]


_attitude_variance = by_release(_error_variance, "adds_quaternion_errors", attitude_variance_about)
"""Variance (rad²) of the attitude error about north, east or down."""


@kernel
def _record_height(ekf, states):
    states[S.PUBLISHED_POSITION + 2] = -ekf.gpos_alt


@kernel
def _record_local_position(ekf, states):
    states[S.PUBLISHED_POSITION] = ekf.local.north
    states[S.PUBLISHED_POSITION + 1] = ekf.local.east
    states[S.PUBLISHED_POSITION + 2] = -ekf.gpos_alt


_record_position_states = by_release(_record_height, "keeps_position_local", _record_local_position)
"""v1.16 publishes no horizontal position among the states."""


@kernel
def _record_scored_states(ekf, row):
    row.timestamp_sample = ekf.time_delayed_us
    for i in range(4):
        row.quaternion[i] = ekf.q[i]
    for i in range(3):
        row.velocity[i] = ekf.vel[i]
        row.attitude_variance[i] = _attitude_variance(ekf, i)
        row.velocity_variance[i] = ekf.P[S.VELOCITY + i, S.VELOCITY + i]
        row.position_variance[i] = ekf.P[S.POSITION + i, S.POSITION + i]


@kernel
def _is_finite(ekf):
    """Whether all states and variances are finite in single precision, as they are published."""
    finite = abs(ekf.gpos_alt) < SINGLE_PRECISION_LIMIT
    for i in range(S.ERROR_STATE_SIZE):
        finite &= abs(ekf.P[i, i]) < SINGLE_PRECISION_LIMIT
    for i in range(4):
        finite &= abs(ekf.q[i]) < SINGLE_PRECISION_LIMIT
    for i in range(3):
        finite &= abs(ekf.vel[i]) < SINGLE_PRECISION_LIMIT
        finite &= abs(ekf.gyro_bias[i]) < SINGLE_PRECISION_LIMIT
        finite &= abs(ekf.accel_bias[i]) < SINGLE_PRECISION_LIMIT
        finite &= abs(ekf.mag_I[i]) < SINGLE_PRECISION_LIMIT
        finite &= abs(ekf.mag_B[i]) < SINGLE_PRECISION_LIMIT
    finite &= abs(ekf.wind_vel[0]) < SINGLE_PRECISION_LIMIT
    finite &= abs(ekf.wind_vel[1]) < SINGLE_PRECISION_LIMIT
    return finite and abs(ekf.terrain) < SINGLE_PRECISION_LIMIT


@kernel
def _note_published(ekf, params, now, timestamp):
    """Position and velocity of the body's origin: the predictor's, which are the IMU's, less its lever arm."""
    output, newest = ekf.output, ekf.output.newest
    offset = rotate_to_earth(output.R_to_earth, params.EKF2_IMU_POS_X, params.EKF2_IMU_POS_Y, params.EKF2_IMU_POS_Z)
    now.timestamp = timestamp
    now.is_kept = False
    for axis in range(3):
        now.pos[axis] = newest.pos[axis] - offset[axis]
        now.vel[axis] = newest.vel[axis] - output.vel_imu_rel_body[axis]
    for i in range(4):
        now.q[i] = newest.q[i]
    now.ref_lat, now.ref_lon, now.ref_alt = output.ref_lat, output.ref_lon, output.ref_alt
    now.origin_lat, now.origin_lon, now.origin_alt = ekf.origin.lat_rad, ekf.origin.lon_rad, altitude_at_origin(ekf)
    now.eph = _horizontal_accuracy(ekf)
    now.epv = np.sqrt(ekf.P[S.POSITION + 2, S.POSITION + 2])
    reset = ekf.state_reset
    now.xy_reset_counter = reset.pos_ne_counter
    now.z_reset_counter = reset.pos_d_counter
    now.vxy_reset_counter = reset.vel_ne_counter
    now.vz_reset_counter = reset.vel_d_counter
    now.heading_reset_counter = reset.quat_counter
    now.xy_valid = is_local_horizontal_position_valid(ekf)
    now.z_valid = is_local_vertical_position_valid(ekf) or is_local_vertical_velocity_valid(ekf)


@kernel
def _record_position_of_steps(ekf, recorder, rows):
    """Keep the first row, and around a step of a reset counter that of the step and the two before it."""
    published, n = recorder.published, recorder.updates
    now = published[n % PUBLISHED_KEPT]
    if n == 0:
        _record_position(ekf, now, recorder, rows)
        return
    before = published[(n - 1) % PUBLISHED_KEPT]
    if (
        now.xy_reset_counter != before.xy_reset_counter
        or now.z_reset_counter != before.z_reset_counter
        or now.vxy_reset_counter != before.vxy_reset_counter
        or now.vz_reset_counter != before.vz_reset_counter
        or now.heading_reset_counter != before.heading_reset_counter
    ):
        earlier = published[(n - 2) % PUBLISHED_KEPT]
        if not earlier.is_kept:
            _record_position(ekf, earlier, recorder, rows)
        if not before.is_kept:
            _record_position(ekf, before, recorder, rows)
        _record_position(ekf, now, recorder, rows)


@kernel
def _record_position(ekf, published, recorder, rows):
    row = rows[recorder.position_rows]
    recorder.position_rows += 1
    published.is_kept = True
    x, y = _local_position(ekf, published, recorder.projection)
    row.timestamp = published.timestamp
    row.timestamp_sample = published.timestamp
    row.x = x
    row.y = y
    row.z = published.pos[2] - published.ref_alt + published.origin_alt
    row.vx = published.vel[0]
    row.vy = published.vel[1]
    row.vz = published.vel[2]
    q = published.q
    row.heading = np.arctan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]))
    row.eph = published.eph
    row.epv = published.epv
    for i in range(4):
        row.q[i] = q[i]
    row.xy_reset_counter = published.xy_reset_counter
    row.z_reset_counter = published.z_reset_counter
    row.vxy_reset_counter = published.vxy_reset_counter
    row.vz_reset_counter = published.vz_reset_counter
    row.heading_reset_counter = published.heading_reset_counter
    row.xy_valid = published.xy_valid
    row.z_valid = published.z_valid


@kernel
def _projected_position(ekf, published, known):
    """North and east (m) of the local origin; `known` is a PROJECTION, renewed where it is another's."""
    if known.metres_north == 0.0 or known.ref_lat != published.ref_lat or known.ref_alt != published.ref_alt:
        known.ref_lat, known.ref_alt = published.ref_lat, published.ref_alt
        known.metres_north, known.metres_east = metres_per_radian(published.ref_lat, published.ref_alt)
    if known.cos_origin == 0.0 or known.origin_lat != published.origin_lat:
        known.origin_lat = published.origin_lat
        known.sin_origin, known.cos_origin = math.sin(published.origin_lat), math.cos(published.origin_lat)
    lat = wrap_pi(published.ref_lat + published.pos[0] / known.metres_north)
    lon = wrap_pi(published.ref_lon + published.pos[1] / known.metres_east)
    return project_about(known.sin_origin, known.cos_origin, published.origin_lon, lat, lon)


@kernel
def _predicted_position(ekf, published, known):
    """Where the predictor counts from the origin, its position is the local one."""
    return published.pos[0], published.pos[1]


_local_position = by_release(_projected_position, "keeps_position_local", _predicted_position)


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
    flags = last.flags
    differences = np.uint8(0)
    for i in range(N_CONTROL):
        differences |= views.cs[i] ^ flags[i]
    for i in range(N_FAULT):
        differences |= views.fs[i] ^ flags[N_CONTROL + i]
    for i in range(N_REJECTION):
        differences |= views.reject[i] ^ flags[N_CONTROL + N_FAULT + i]
    if differences == 0 and timestamp < last.timestamp + FLAGS_INTERVAL_US:
        return
    for i in range(N_CONTROL):
        flags[i] = views.cs[i]
    for i in range(N_FAULT):
        flags[N_CONTROL + i] = views.fs[i]
    for i in range(N_REJECTION):
        flags[N_CONTROL + N_FAULT + i] = views.reject[i]
    last.timestamp = timestamp
    rows[recorder.flag_rows] = last
    recorder.flag_rows += 1
