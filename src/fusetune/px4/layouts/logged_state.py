"""The state of the vehicle's own estimator as a log of any release holds it, in the units and layout of v1.16."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fusetune.px4.flight import Flight, TopicTable, row_count, select_rows, stacked
from fusetune.px4.layouts.estimator_instances import primary_instance_at, selector_status
from fusetune.px4.layouts.state_layout import (
    UPDATE_INTERVAL_S,
    StateLayout,
    state_counts,
    state_layout,
    tells_bias_rates,
)

LOGGED_STATE_TOPICS = (
    "estimator_states",
    "estimator_status",
    "estimator_status_flags",
    "estimator_sensor_bias",
    "estimator_selector_status",
    "vehicle_local_position",
    "vehicle_gps_position",
)
"""What `logged_states` reads of a flight."""

HORIZON_LAG_US = 20_000
"""A sample time nearer than this to the time of publication is that of the newest IMU sample, not of the horizon."""

MAX_HANDOVER_AGE_US = 5_000_000
"""Biases and field change little in such a time."""

ERROR_STATES = 24
MAX_NORM_ERROR = 0.1
"""By which the norm of a logged quaternion may differ from 1."""

MIN_FIX_TYPE = 3
MAX_ORIGIN_DISTANCE_DEG = 1.0
METRES_PER_DEGREE = 111_195.0
"""Of a great circle on a sphere with the mean radius of the Earth, 6371 km."""


@dataclass(frozen=True)
class LoggedState:
    """State of the estimator at its fusion time horizon.

    Attributes
    ----------
    time_us : horizon
    q : (4,) w, x, y, z, body to NED
    velocity, position : (3,) NED, m/s and m; the position relative to the local origin
    origin : latitude, longitude (deg) and altitude (m) of the local origin; None while unknown
    gyro_bias, accel_bias : (3,) rad/s, m/s²
    mag_earth, mag_body : (3,) Gauss; zero where they are not estimated
    wind : (2,) m/s
    variances : (24,) of the error state of v1.16: rotation in NED, velocity, position, gyro and accelerometer bias,
        earth field, body field, wind, terrain; zero where the release does not estimate it
    flags : names of the control status flags that are set, without prefix
    """

    time_us: int
    q: np.ndarray
    velocity: np.ndarray
    position: np.ndarray
    origin: tuple[float, float, float] | None
    gyro_bias: np.ndarray
    accel_bias: np.ndarray
    mag_earth: np.ndarray
    mag_body: np.ndarray
    wind: np.ndarray
    variances: np.ndarray
    flags: frozenset[str]

    @property
    def is_aligned(self) -> bool:
        """Whether the estimator knows tilt and heading."""
        return {"tilt_align", "yaw_align"} <= self.flags

    @property
    def uses_gnss(self) -> bool:
        return bool({"gnss_pos", "gnss_vel"} & self.flags)


@dataclass(frozen=True)
class Handover:
    """Another estimator instance became the primary one.

    Attributes
    ----------
    time_us : when
    state : of the new primary instance, the nearest to that time that the log holds
    """

    time_us: int
    state: LoggedState


def logged_handovers(flight: Flight) -> tuple[Handover, ...]:
    """Changes of the primary instance for which the log holds a state of the new one, in order of time."""
    selector = selector_status(flight)
    if selector is None or row_count(selector) < 2:
        return ()
    chosen, times = selector["primary_instance"].astype(np.int64), selector["timestamp"].astype(np.int64)
    found = []
    for row in np.flatnonzero(np.diff(chosen) != 0) + 1:
        state = _nearest_state(flight, int(chosen[row]), int(times[row]))
        if state is not None:
            found.append(Handover(int(times[row]), state))
    return tuple(found)


def _nearest_state(flight: Flight, instance: int, time: int) -> LoggedState | None:
    states = _InstanceStates(flight, instance)
    if not len(states.horizons):
        return None
    row = int(np.argmin(np.abs(states.horizons - time)))
    if abs(int(states.horizons[row]) - time) > MAX_HANDOVER_AGE_US:
        return None
    return states.read(row)


def logged_states(flight: Flight, since: int = 0) -> Iterator[LoggedState]:
    """States of the primary estimator instance from a time (µs) on, in order; those that cannot be are left out.

    Parameters
    ----------
    flight : in the layout of `fusetune.px4.layouts.release_layouts.canonical`
    """
    found = {instance: _InstanceStates(flight, instance) for instance in flight.instances("estimator_states")}
    rows = [
        (int(horizon), instance, row)
        for instance, states in found.items()
        for row, horizon in enumerate(states.horizons)
        if horizon >= since
    ]
    rows.sort()
    primary = primary_instance_at(flight, np.array([time for time, _, _ in rows], np.int64))
    for (_, instance, row), chosen in zip(rows, primary.tolist(), strict=True):
        if instance == chosen:
            state = found[instance].read(row)
            if state is not None:
                yield state


def why_no_state(flight: Flight) -> str:
    """What keeps every state of the vehicle's estimator from being read, in words; empty where some can be.

    Parameters
    ----------
    flight : in the layout of `fusetune.px4.layouts.release_layouts.canonical`
    """
    found = [_InstanceStates(flight, instance) for instance in flight.instances("estimator_states")]
    found = [states for states in found if len(states.horizons)]
    if not found:
        return "the log holds no states of the vehicle's own estimator"
    if next(logged_states(flight), None) is not None:
        return ""
    problems = [states.problem for states in found if states.problem]
    why = problems[0] if problems else "none is a number throughout, with an attitude"
    return f"the states of the vehicle's own estimator cannot be read: {why}"


class _InstanceStates:
    """The states that one estimator instance logged.

    Attributes
    ----------
    horizons : (rows,) fusion time horizon of each, µs
    problem : why none of them can be read; empty where they can be
    """

    def __init__(self, flight: Flight, instance: int) -> None:
        self._flight, self._instance = flight, instance
        table = flight.topic("estimator_states", instance)
        self._table: TopicTable = {"timestamp": np.zeros(0, np.int64)} if table is None else table
        self.horizons = _horizons(flight, self._table)
        local = flight.topic("vehicle_local_position")
        self._local = local if local is not None and row_count(local) else None
        self._layout: StateLayout | None = None
        self.problem = self._recognise() if len(self.horizons) else "there are none"

    def _recognise(self) -> str:
        self._layout = state_layout(self._table, self._flight.topic("estimator_sensor_bias", self._instance))
        if self._layout is None:
            states, variances = state_counts(self._table)
            return f"{states} states with {variances} variances are the layout of no release"
        if self._local is None:
            return "the log lacks vehicle_local_position"
        self._states, self._variances = stacked(self._table, "states"), stacked(self._table, "covariances")
        return ""

    def read(self, row: int) -> LoggedState | None:
        """The state of one row; None where it cannot be read or is none."""
        if self._layout is None or self._local is None:
            return None
        flight, instance, layout, time = self._flight, self._instance, self._layout, int(self.horizons[row])
        states = self._states[row].copy()  # those of the whole flight need not stay for one
        q = states[:4]
        norm = float(np.linalg.norm(q))
        if not abs(norm - 1.0) < MAX_NORM_ERROR:
            return None
        q = q / norm
        position, origin = _position(self._local, states, time, layout)
        origin = _checked_origin(origin, position, flight.topic("vehicle_gps_position"), time)
        gyro_bias, accel_bias = _biases(flight, instance, states, time, layout)
        state = LoggedState(
            time_us=time,
            q=q,
            velocity=states[4:7],
            position=position,
            origin=origin,
            gyro_bias=gyro_bias,
            accel_bias=accel_bias,
            mag_earth=states[16:19],
            mag_body=states[19:22],
            wind=states[22:24],
            variances=_error_variances(self._variances[row], q, layout),
            flags=_flags(flight, instance, time),
        )
        numbers = (q, state.velocity, position, gyro_bias, accel_bias, state.mag_earth, state.mag_body, state.variances)
        return state if all(np.isfinite(part).all() for part in numbers) else None


def _horizons(flight: Flight, table: TopicTable) -> np.ndarray:
    """Fusion time horizon of each row.

    Before v1.13 the sample time is that of the newest IMU sample; the horizon is then the longest delay earlier.
    """
    published = table["timestamp"].astype(np.int64)
    sampled = table.get("timestamp_sample", published).astype(np.int64)
    sampled = np.where(sampled > 0, sampled, published)
    if not len(published) or np.median(published - sampled) > HORIZON_LAG_US:
        return sampled
    delays = [
        float(value)
        for name, value in flight.parameters.initial.items()
        if name.startswith("EKF2_") and name.endswith("_DELAY")
    ]
    return sampled - round(max([0.0, *delays]) * 1e3)


def _position(
    local: TopicTable, states: np.ndarray, time: int, layout: StateLayout
) -> tuple[np.ndarray, tuple[float, float, float] | None]:
    """Position relative to the local origin, and the origin."""
    sampled = local.get("timestamp_sample", local["timestamp"]).astype(np.int64)
    row = int(np.argmin(np.abs(sampled - time)))
    known = bool(local.get("xy_global", np.ones(1))[row if "xy_global" in local else 0])
    reference = [float(local[name][row]) if name in local else np.nan for name in ("ref_lat", "ref_lon", "ref_alt")]
    origin = None
    if known and np.isfinite(reference).all() and reference[:2] != [0.0, 0.0]:
        origin = (reference[0], reference[1], reference[2])
    if layout.has_local_position:
        return states[7:10], origin
    xy = [float(np.interp(time, sampled, local[name])) for name in ("x", "y")]
    down = states[9] + (origin[2] if origin else 0.0)
    return np.array([*xy, down]), origin


def _checked_origin(
    origin: tuple[float, float, float] | None, position: np.ndarray, gnss: TopicTable | None, time: int
) -> tuple[float, float, float] | None:
    """The origin, put where GNSS says the vehicle is if the two are degrees apart (logs whose place was disguised)."""
    if origin is None or gnss is None or "latitude_deg" not in gnss or not row_count(gnss):
        return origin
    row = int(np.argmin(np.abs(gnss["timestamp"].astype(np.int64) - time)))
    latitude, longitude = float(gnss["latitude_deg"][row]), float(gnss["longitude_deg"][row])
    has_fix = int(gnss["fix_type"][row]) >= MIN_FIX_TYPE if "fix_type" in gnss else True
    apart = max(abs(latitude - origin[0]), abs(longitude - origin[1]))
    if not has_fix or not MAX_ORIGIN_DISTANCE_DEG < apart < np.inf:
        return origin
    north_deg = float(position[0]) / METRES_PER_DEGREE
    east_deg = float(position[1]) / (METRES_PER_DEGREE * float(np.cos(np.radians(latitude))))
    return latitude - north_deg, longitude - east_deg, origin[2]


def _biases(
    flight: Flight, instance: int, states: np.ndarray, time: int, layout: StateLayout
) -> tuple[np.ndarray, np.ndarray]:
    """Biases as rates; of increments per update, those that the log also gives as rates."""
    if layout.has_bias_rates:
        return states[10:13], states[13:16]
    table = flight.topic("estimator_sensor_bias", instance)
    if table is not None and tells_bias_rates(table):
        row = int(np.argmin(np.abs(table["timestamp"].astype(np.int64) - time)))
        nearest = select_rows(table, np.array([row]))
        return stacked(nearest, "gyro_bias")[0], stacked(nearest, "accel_bias")[0]
    return states[10:13] / UPDATE_INTERVAL_S, states[13:16] / UPDATE_INTERVAL_S


def _error_variances(raw: np.ndarray, q: np.ndarray, layout: StateLayout) -> np.ndarray:
    """Variances of the error state of v1.16 from those of the log's layout."""
    variances = np.zeros(ERROR_STATES)
    if layout.has_rotation_variances:
        variances[: layout.variances] = raw[: layout.variances]
    else:
        variances[:3] = rotation_variances(q, raw[:4])
        variances[3:9] = raw[4:10]
        variances[9:15] = raw[10:16] if layout.has_bias_rates else raw[10:16] / UPDATE_INTERVAL_S**2
        variances[15:23] = raw[16:24]
    return np.maximum(variances, 0.0)


def rotation_variances(q: np.ndarray, variances: np.ndarray) -> np.ndarray:
    """Variances (3,) of the rotation error in NED that explain the variances (4,) of a quaternion.

    A small rotation θ in NED changes the quaternion by ½ (0, θ) ⊗ q, so its variances are ¼ Σ B²ᵢⱼ var θⱼ with the
    columns eⱼ ⊗ q of B, if the errors about the three axes are independent. Solved by least squares.
    """
    w, x, y, z = q
    turned = np.array([[-x, -y, -z], [w, z, -y], [-z, w, x], [y, -x, w]])
    solution = np.linalg.lstsq(0.25 * turned**2, variances, rcond=1e-3)[0]
    return np.maximum(solution, 0.0)


def _flags(flight: Flight, instance: int, time: int) -> frozenset[str]:
    """Control status flags in force at a time, those of the first message before it was sent."""
    table = flight.topic("estimator_status_flags", instance)
    if table is None or not row_count(table):
        return frozenset()
    row = max(int(np.searchsorted(table["timestamp"].astype(np.int64), time, side="right")) - 1, 0)
    names = (name for name in table if name.startswith("cs_"))
    return frozenset(name.removeprefix("cs_") for name in names if bool(table[name][row]))
