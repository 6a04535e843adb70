"""What the filters say of the vehicle: attitude, velocity, position, biases, wind, field, and how sure they are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.ground_truth import Truth, read_truth
from fusetune.analyze.metrics.attitude import heading
from fusetune.analyze.replaying.store.state_columns import STATE_COLUMNS, VARIANCE_COLUMNS
from fusetune.px4.flight import TopicTable, stacked
from fusetune.px4.layouts.logged_state_series import LoggedStates, logged_biases, logged_state_series
from fusetune.report.flight_data.content import Figures, Panel, Series, Times, with_gaps
from fusetune.report.flight_data.logged import Logged
from fusetune.report.flight_data.panel_names import axes_of, panel_name
from fusetune.report.flight_data.position_frame import PositionFrame
from fusetune.report.flight_data.replays import Replay
from fusetune.set_names import ONBOARD

_WITH_SIGMA = ("gyro_bias", "accel_bias", "wind", "mag_earth", "mag_body")
_TERRAIN = "terrain"
_OF_TERRAIN = ("cs_rng_terrain", "cs_opt_flow_terrain")
_ONLY_IF_KNOWN = ("wind", "mag_earth", "mag_body", _TERRAIN)
"""States that stay zero where the filter does not estimate them."""
_TURN_DEG = 180.0
_TICK_US = 100


@dataclass(frozen=True)
class Teller:
    """One who tells of the vehicle's motion: a replay, the vehicle's own filter, or the truth.

    Attributes
    ----------
    label, set : of its series
    time, attitude_time : (N,) and (M,) µs
    q : (M, 4) body to NED
    velocity, position : (N, 3) NED, the position in the frame of the panels; NaN where they are not valid
    """

    label: str
    set: str | None
    time: Times
    velocity: Figures
    position: Figures
    attitude_time: Times
    q: Figures

    @cached_property
    def euler_deg(self) -> Figures:
        """Roll, pitch and heading (M, 3), degrees."""
        w, x, y, z = self.q.T
        roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
        return np.degrees(np.column_stack([roll, pitch, heading(self.q)]))


def tellers(logged: Logged, replays: Sequence[Replay], labels: Mapping[str, str], frame: PositionFrame) -> list[Teller]:
    """All who tell: replays first, then the vehicle's own filter, then the truth of a simulated flight."""
    found = [_of_replay(one, labels.get(one.name, one.name)) for one in replays]
    own = _of_vehicle(logged, labels[ONBOARD], frame)
    truth = read_truth(logged.flight)
    found += [] if own is None else [own]
    found += [] if truth is None else [_of_truth(truth, frame)]
    return found


def motion_panels(
    told: Sequence[Teller], gnss: TopicTable | None, gnss_delay_us: int, frame: PositionFrame
) -> Iterator[Panel]:
    """Attitude, velocity, position and height.

    Parameters
    ----------
    gnss : `vehicle_gps_position` in the layout of v1.16
    gnss_delay_us : by which its measurements are older than their time stamps
    """
    for axis in range(3):
        angles = ((one, one.attitude_time, one.euler_deg[:, axis]) for one in told if one.attitude_time.size)
        yield from _panel("attitude", axis, (_turning(*one) for one in angles))
    measured = None if gnss is None else frame.measured(gnss, gnss_delay_us)
    for axis in range(3):
        curves = [_told(one, one.time, one.velocity[:, axis]) for one in told]
        points = [] if measured is None else [_points("GNSS", measured.time, measured.velocity[:, axis])]
        yield from _panel("velocity", axis, [*curves, *points])
    for axis in range(3):
        up = axis == 2
        curves = [_told(one, one.time, -one.position[:, 2] if up else one.position[:, axis]) for one in told]
        place = None if measured is None else measured.position
        points = (
            []
            if measured is None or place is None
            else [_points("GNSS", measured.time, -place[:, 2] if up else place[:, axis])]
        )
        yield from _panel("height" if up else "position", 0 if up else axis, [*curves, *points])


@dataclass(frozen=True)
class InnerStates:
    """States of one filter; `biases` may come from another topic than the rest."""

    set: str
    label: str
    states: LoggedStates
    biases: LoggedStates

    def of(self, part: str) -> LoggedStates:
        """Where a part of the state stands."""
        return self.biases if part.endswith("bias") else self.states


def inner_states(logged: Logged, replays: Sequence[Replay], labels: Mapping[str, str]) -> list[InnerStates]:
    """Of the replays and of the vehicle's own filter."""
    found = []
    for one in replays:
        states = _replayed_states(one)
        found.append(InnerStates(one.name, labels.get(one.name, one.name), states, states))
    own = logged_state_series(logged.flight)
    if own is not None:
        found.append(InnerStates(ONBOARD, labels[ONBOARD], own, logged_biases(logged.flight) or own))
    return found


def inner_state_panels(told: Sequence[InnerStates]) -> Iterator[Panel]:
    """Biases, wind and field with their standard deviations, and the uncertainty of the motion."""
    for part in (*_WITH_SIGMA, _TERRAIN):
        for axis in range(axes_of(part)):
            yield from _panel(part, axis, (_state(part, axis, one) for one in told))
    for panel, part, axes in _UNCERTAINTIES:
        for number, chosen in enumerate(axes):
            series = (
                Series(one.label, one.states.time, np.sqrt(one.states.variances[part][:, chosen].sum(axis=1)), one.set)
                for one in told
                if part in one.states.variances
            )
            yield from _panel(panel, number, series)


def earth_field(told: Sequence[InnerStates]) -> Series | None:
    """Strength of the earth's field as the first filter holds it that does; G."""
    for one in told:
        field = one.states.values["mag_earth"]
        if np.any(field):
            strength = np.linalg.norm(field, axis=1)
            strength[strength == 0.0] = np.nan
            return Series(f"of the earth, {one.label}", one.states.time, strength, one.set)
    return None


_UNCERTAINTIES = (
    ("attitude_sigma", "attitude", ([0, 1], [2])),
    ("velocity_sigma", "velocity", ([0, 1], [2])),
    ("position_sigma", "position", ([0, 1], [2])),
)
"""Panel, part of the error state, and the axes whose variances are summed for each of its curves."""


def _of_replay(replay: Replay, label: str) -> Teller:
    table = replay.local_position
    time = table["timestamp"].astype(np.int64)
    velocity = np.column_stack([table[name] for name in ("vx", "vy", "vz")])
    position = np.column_stack([table[name] for name in ("x", "y", "z")])
    _unless(position[:, :2], table.get("xy_valid"))
    _unless(position[:, 2:], table.get("z_valid"))
    names = [f"q_{number}" for number in range(4)]
    if not set(names) <= set(table):  # a replay of another program may lack it
        return Teller(label, replay.name, time, velocity, position, time[:0], np.zeros((0, 4)))
    q = np.column_stack([table[name] for name in names])
    return Teller(label, replay.name, time, velocity, position, time, q)


def _of_vehicle(logged: Logged, label: str, frame: PositionFrame) -> Teller | None:
    local, attitude = logged.topic("vehicle_local_position"), logged.topic("vehicle_attitude")
    if local is None and attitude is None:
        return None
    nowhere = np.zeros((0, 3))
    time, velocity, position = np.zeros(0, np.int64), nowhere, nowhere
    if local is not None and {"vx", "vy", "vz"} <= set(local):
        time = local["timestamp"].astype(np.int64)
        velocity = np.column_stack([local[name] for name in ("vx", "vy", "vz")]).astype(np.float64)
        position = frame.of_vehicle(local)
        for values, valid in (
            (velocity[:, :2], "v_xy_valid"),
            (velocity[:, 2:], "v_z_valid"),
            (position[:, :2], "xy_valid"),
            (position[:, 2:], "z_valid"),
        ):
            _unless(values, local.get(valid))
    has_attitude = attitude is not None and "q[3]" in attitude
    attitude_time = attitude["timestamp"].astype(np.int64) if attitude is not None and has_attitude else time[:0]
    q = stacked(attitude, "q") if attitude is not None and has_attitude else np.zeros((0, 4))
    return Teller(label, ONBOARD, time, velocity, position, attitude_time, q)


def _of_truth(truth: Truth, frame: PositionFrame) -> Teller:
    position = frame.of_reference(truth.position, truth.reference)
    return Teller("truth", None, truth.time, truth.velocity, position, truth.attitude_time, truth.quaternion)


def _unless(values: Figures, valid: npt.NDArray | None) -> None:
    """Make no number of what is not valid, in place."""
    if valid is not None:
        values[~valid.astype(bool)] = np.nan


def _replayed_states(replay: Replay) -> LoggedStates:
    # the height of the terrain is a state of every flight, but nothing tells it without these
    terrain = any(np.any(replay.status_flags[flag]) for flag in _OF_TERRAIN if flag in replay.status_flags)
    parts = (*_WITH_SIGMA, _TERRAIN) if terrain else _WITH_SIGMA
    spread = ("attitude", "velocity", "position", *_WITH_SIGMA)
    names = [name for part in parts for name in STATE_COLUMNS[part]]
    names += [name for part in spread for name in VARIANCE_COLUMNS[part]]
    table = replay.states(["timestamp_sample", *names])
    return LoggedStates(
        table["timestamp_sample"].astype(np.int64),
        {part: np.column_stack([table[name] for name in STATE_COLUMNS[part]]) for part in parts},
        {part: np.maximum(np.column_stack([table[name] for name in VARIANCE_COLUMNS[part]]), 0.0) for part in spread},
    )


def _state(part: str, axis: int, one: InnerStates) -> Series | None:
    told = one.of(part)
    if part not in told.values or (part in _ONLY_IF_KNOWN and not np.any(told.values[part][:, axis])):
        return None
    columns = [told.values[part][:, axis]]
    if part in told.variances:
        columns.append(np.sqrt(told.variances[part][:, axis]))
    time, (values, *sigma) = with_gaps(told.time, columns)
    return Series(one.label, time, values, one.set, sigma=sigma[0] if sigma else None)


def _told(one: Teller, time: Times, values: Figures) -> Series:
    time, (values,) = with_gaps(time, (values,))
    return Series(one.label, time, values, one.set)


def _turning(one: Teller, time: Times, angle: Figures) -> Series:
    """An angle, parted where it turns over from 180° to −180°."""
    over = np.flatnonzero(np.abs(np.diff(angle)) > _TURN_DEG) + 1
    if over.size:
        time, angle = np.insert(time, over, time[over - 1] + _TICK_US), np.insert(angle, over, np.nan)
    return _told(one, time, angle)


def _points(label: str, time: Times, values: Figures) -> Series:
    return Series(label, time, values, draw="points")


def _panel(panel: str, axis: int, series: Iterable[Series | None]) -> Iterator[Panel]:
    known = tuple(one for one in series if one is not None and np.any(np.isfinite(one.values)))
    if known:
        name = panel_name(panel, axis)
        number = f"{panel}.{axis}" if axes_of(panel) > 1 else panel
        yield Panel(number, name.group, name.title, name.unit, known)
