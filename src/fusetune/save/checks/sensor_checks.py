"""Checks of what the sensors say: values that stand still, and values that no vehicle on earth can have.

A sensor that is stuck repeats its last value: real ones do not, for noise moves every sample. PX4's own check is of
this kind (`DataValidator`: the same value a hundred times is stale). On the ground a simulation may be without noise,
so the time in the air is judged, or the whole log where that is unknown; a log without flight gets a warning at most.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from fusetune.px4.flight import Flight, TopicTable, field_names, select_rows, stacked
from fusetune.px4.parameters.ekf2_parameters import complete
from fusetune.save.checks.check import Check
from fusetune.save.log_facts import airborne_intervals, is_airborne
from fusetune.save.thresholds import VerdictThresholds

STANDARD_GRAVITY_M_S2 = 9.80665
_FIX_3D = 3
_MAG_TYPE_NONE = 5
_FEWEST_STUCK_ROWS = 5
_FEWEST_ROWS_IN_A_SECOND = 10
_CHECK_SENSOR = "Check the sensor, its wiring and its driver before the next flight; give a simulated one noise"
_GNSS_POSITION = ("latitude_deg", "longitude_deg")
_GNSS_VELOCITY = ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")


class Standstill(NamedTuple):
    """How long a sensor held one value."""

    longest_s: float
    share: float
    """Of the time that was looked at, how much lies in standstills beyond the limit."""
    value: float
    """What the longest one held."""


def standstill(table: TopicTable, columns: Sequence[str], limit_s: float, flying: np.ndarray) -> Standstill:
    """Times in which some columns together hold one value.

    Parameters
    ----------
    columns
        All of them have to stand still.
    limit_s
        Shorter times are none, and neither are fewer than five rows.
    flying
        (rows - 1,) bool, which steps from row to row count.
    """
    time_s = table["timestamp"].astype(np.int64) * 1e-6
    steps = np.where(flying, np.maximum(np.diff(time_s), 0.0), 0.0)
    same = flying.copy()
    for column in columns:
        same &= table[column][1:] == table[column][:-1]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]])))
    begins, ends = edges[::2], edges[1::2]
    passed = np.append(0.0, np.cumsum(steps))
    lengths = np.where(ends - begins >= _FEWEST_STUCK_ROWS - 1, passed[ends] - passed[begins], 0.0)
    if not len(lengths) or not passed[-1]:
        return Standstill(0.0, 0.0, 0.0)
    longest = int(np.argmax(lengths))
    share = float(np.sum(lengths[lengths > limit_s]) / passed[-1])
    return Standstill(float(lengths[longest]), share, float(table[columns[0]][begins[longest]]))


def _flying_steps(flight: Flight, table: TopicTable) -> np.ndarray:
    """Which steps from row to row are in the air, (rows - 1,) bool; all where that is unknown or never was."""
    middle = (table["timestamp"][1:] + table["timestamp"][:-1]) // 2
    if not airborne_intervals(flight):
        return np.ones(len(middle), np.bool_)
    return is_airborne(flight, middle)


class _Subject(NamedTuple):
    """What must not stand still."""

    name: str
    """Of the check."""
    what: str
    table: TopicTable
    groups: Sequence[Sequence[str]]
    """Columns that may not all stand still together."""
    limit_s: float


def _stuck(flight: Flight, subject: _Subject, limits: VerdictThresholds) -> Check:
    flying = _flying_steps(flight, subject.table)
    limit_s = subject.limit_s
    found = [standstill(subject.table, group, limit_s, flying) for group in subject.groups]
    worst = max(found, key=lambda one: (one.share, one.longest_s))
    if worst.longest_s <= limit_s:
        return Check(subject.name, "pass", f"{subject.what} never stands still", "", worst.longest_s, limit_s)
    said = f"{subject.what} holds one value ({worst.value:.7g}) for up to {worst.longest_s:.1f} s"
    if worst.share > limits.max_stuck_share and airborne_intervals(flight) != []:
        reason = f"{said}, in {worst.share:.0%} of the time: it is stuck, and the flight says nothing about the filter"
        return Check(subject.name, "fail", reason, _CHECK_SENSOR, worst.share, limits.max_stuck_share)
    return Check(subject.name, "warning", f"{said}: it was stuck", _CHECK_SENSOR, worst.longest_s, limit_s)


def accelerometer_gravity(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the accelerometer sees gravity: median of the specific force averaged over seconds, in g.

    Vibration averages out within a second, and no vehicle falls, or pulls two g, for half of its flight.
    """
    name, imu = "accelerometer_gravity", flight.topics["sensor_combined", 0]
    second = (imu["timestamp"] - imu["timestamp"].min()) // 1_000_000
    seconds, index, rows = np.unique(second, return_inverse=True, return_counts=True)
    sums = [np.bincount(index, weights=axis, minlength=len(seconds)) for axis in stacked(imu, "accelerometer_m_s2").T]
    force = np.linalg.norm(np.stack(sums, axis=1) / rows[:, None], axis=1)
    whole = rows >= min(_FEWEST_ROWS_IN_A_SECOND, rows.max())
    share = float(np.median(force[whole])) / STANDARD_GRAVITY_M_S2
    said = f"the accelerometer measures {share:.2f} g in the mean"
    remedy = "Calibrate the accelerometer; check that its driver gives m/s² and its scale (CAL_ACC0_XSCALE …)"
    for threshold, is_outside in (
        (limits.min_gravity_share, share < limits.min_gravity_share),
        (limits.max_gravity_share, share > limits.max_gravity_share),
    ):
        if is_outside:
            return Check(name, "fail", f"{said}: it does not see gravity", remedy, share, threshold)
    for threshold, is_outside in (
        (limits.low_gravity_share, share < limits.low_gravity_share),
        (limits.high_gravity_share, share > limits.high_gravity_share),
    ):
        if is_outside:
            return Check(name, "warning", f"{said}, far from gravity", remedy, share, threshold)
    return Check(name, "pass", said, "", share, limits.low_gravity_share)


def accelerometer_stuck(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether an axis of the accelerometer stands still."""
    return _imu_stuck(flight, limits, "accelerometer_stuck", "the accelerometer", "accelerometer_m_s2")


def gyroscope_stuck(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether an axis of the gyroscope stands still."""
    return _imu_stuck(flight, limits, "gyroscope_stuck", "the gyroscope", "gyro_rad")


def _imu_stuck(flight: Flight, limits: VerdictThresholds, name: str, what: str, vector: str) -> Check:
    imu = flight.topics["sensor_combined", 0]
    groups = [[column] for column in field_names(imu, vector)]
    return _stuck(flight, _Subject(name, what, imu, groups, limits.high_stuck_imu_s), limits)


def imu_repeats(flight: Flight, limits: VerdictThresholds) -> Check:
    """Share of the IMU rows that say the same as the row before, in all axes: samples that were logged twice."""
    name, imu, threshold = "imu_repeats", flight.topics["sensor_combined", 0], limits.high_repeated_share
    columns = [*field_names(imu, "gyro_rad"), *field_names(imu, "accelerometer_m_s2")]
    flying = _flying_steps(flight, imu)
    same = flying & np.all([imu[column][1:] == imu[column][:-1] for column in columns], axis=0)
    share = float(np.sum(same) / max(np.sum(flying), 1))
    if share > threshold:
        reason = f"{share:.0%} of the IMU samples repeat the one before"
        remedy = "Check the IMU's driver: the same sample must not be published twice"
        return Check(name, "warning", reason, remedy, share, threshold)
    return Check(name, "pass", f"{share:.1%} of the IMU samples repeat the one before", "", share, threshold)


def magnetometer_stuck(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether an axis of the magnetometer stands still."""
    name, table = "magnetometer_stuck", flight.topic("vehicle_magnetometer")
    if table is None or len(table["timestamp"]) < _FEWEST_STUCK_ROWS or not _uses_magnetometer(flight):
        return Check(name, "does-not-apply", "the magnetometer is switched off or not logged")
    groups = [[column] for column in field_names(table, "magnetometer_ga")]
    return _stuck(flight, _Subject(name, "the magnetometer", table, groups, limits.high_stuck_aid_s), limits)


def magnetometer_strength(flight: Flight, limits: VerdictThresholds) -> Check:
    """Median strength of the measured field, which the earth's bounds."""
    name, table = "magnetometer_strength", flight.topic("vehicle_magnetometer")
    if table is None or not len(table["timestamp"]) or not _uses_magnetometer(flight):
        return Check(name, "does-not-apply", "the magnetometer is switched off or not logged")
    strength = float(np.median(np.linalg.norm(stacked(table, "magnetometer_ga"), axis=1)))
    said = f"the magnetometer measures a field of {strength:.3g} Gs"
    low, high = limits.low_field_strength_ga, limits.high_field_strength_ga
    if not low <= strength <= high:
        remedy = "Calibrate the magnetometer away from steel and currents; check that its driver gives Gauss"
        reason = f"{said}; the earth's field has 0.2 to 0.7"
        return Check(name, "warning", reason, remedy, strength, low if strength < low else high)
    return Check(name, "pass", said, "", strength, low)


def barometer_stuck(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the barometer stands still."""
    name, table = "barometer_stuck", flight.topic("vehicle_air_data")
    if table is None or len(table["timestamp"]) < _FEWEST_STUCK_ROWS or not _parameters(flight)["EKF2_BARO_CTRL"]:
        return Check(name, "does-not-apply", "the barometer is switched off or not logged")
    groups = [["baro_alt_meter"]]
    return _stuck(flight, _Subject(name, "the barometer", table, groups, limits.high_stuck_aid_s), limits)


def gnss_stuck(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether GNSS position or velocity stands still in flight, while there is a fix."""
    name, table = "gnss_stuck", flight.topic("vehicle_gps_position")
    if table is None or "fix_type" not in table or not int(_parameters(flight)["EKF2_GPS_CTRL"]):
        return Check(name, "does-not-apply", "GNSS is switched off or not logged")
    table = select_rows(table, table["fix_type"] >= _FIX_3D)
    groups = [group for group in (_GNSS_POSITION, _GNSS_VELOCITY) if all(column in table for column in group)]
    if len(table["timestamp"]) < _FEWEST_STUCK_ROWS or not groups:
        return Check(name, "does-not-apply", "GNSS never has a fix, or lacks position and velocity")
    if airborne_intervals(flight) == []:
        return Check(name, "does-not-apply", "on the ground a receiver may hold its position")
    return _stuck(flight, _Subject(name, "GNSS", table, groups, limits.high_stuck_aid_s), limits)


def _uses_magnetometer(flight: Flight) -> bool:
    return _parameters(flight)["EKF2_MAG_TYPE"] != _MAG_TYPE_NONE


def _parameters(flight: Flight) -> dict[str, float]:
    return complete(flight.parameters.initial, {}, flight.release)


IMU_CHECKS: tuple[Callable[[Flight, VerdictThresholds], Check], ...] = (
    accelerometer_gravity,
    accelerometer_stuck,
    gyroscope_stuck,
    imu_repeats,
)
AID_CHECKS: tuple[Callable[[Flight, VerdictThresholds], Check], ...] = (
    magnetometer_stuck,
    magnetometer_strength,
    barometer_stuck,
    gnss_stuck,
)
