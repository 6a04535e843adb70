"""Whether the magnetometer turns as the vehicle does.

The earth's field stands still while the vehicle tilts and turns. If samples only show that with their axes taken for
others, the sensor is mounted otherwise than its parameters say.
"""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from fusetune.check import check
from fusetune.finding import Finding
from fusetune.px4.flight import Flight, TopicTable, stacked
from fusetune.save.checks.judged_flight import MAG, JudgedFlight

MIN_SAMPLES, MAX_SAMPLES = 24, 500
_ATTITUDE = "vehicle_attitude"
QUARTER_TURNS = tuple(
    matrix
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3))
    if np.linalg.det(matrix := np.diag(signs)[:, order]) > 0.0
)
"""The 24 rotations (3, 3) that take axes to axes."""

_REMEDY = "Compare CAL_MAG0_ROT (and SENS_BOARD_ROT) with how the sensor sits; in a simulation, ask its sensor model"


@check(topics=(MAG, _ATTITUDE), thresholds=("max_field_scatter_left",))
def magnetometer_mounting(judged: JudgedFlight) -> Finding:
    """Whether the field stands still over the ground, or would if the sensor were turned."""
    threshold = judged.limits.max_field_scatter_left
    found_together = attitudes_and_fields(judged.flight)
    if found_together is None:
        return magnetometer_mounting.does_not_apply("without magnetometer or attitude the two cannot be compared")
    q, measured = found_together
    if len(measured) < MIN_SAMPLES:
        found = f"only {len(measured)} magnetometer samples with an attitude"
        return magnetometer_mounting.does_not_apply(found)
    mounting, left = stillest_mounting(q, measured)
    if left > threshold:
        return magnetometer_mounting.passed("no other mounting would make the field stand stiller", left, threshold)
    found = f"the field turns as if the magnetometer sat otherwise, by {described(mounting)}"
    return magnetometer_mounting.warned(found, _REMEDY, left, threshold)


def attitudes_and_fields(flight: Flight) -> tuple[np.ndarray, np.ndarray] | None:
    """Attitudes (N, 4), w, x, y, z, body to NED, and samples (N, 3), Gauss, at the same times, as `stillest_mounting`
    takes them; None where the log has one of them not."""
    table, attitude = flight.topic(MAG), flight.topic(_ATTITUDE)
    if table is None or attitude is None or "q[0]" not in attitude or "magnetometer_ga[0]" not in table:
        return None
    # damaged numbers may be of the kind of NaN that even a cast complains of; they are left out
    with np.errstate(invalid="ignore"):
        return _together(table, attitude)


def stillest_mounting(q: np.ndarray, measured: np.ndarray) -> tuple[np.ndarray, float]:
    """Of all rotations by quarter turns, the one in which the field's inclination and strength scatter least.

    Its declination is left out: the heading that a filter finds by a turned magnetometer is resets and errors.

    Parameters
    ----------
    q : (N, 4) attitudes, w, x, y, z, body to NED
    measured : (N, 3) field in the body, Gauss

    Returns
    -------
    Rotation (3, 3) from axes that turn with the vehicle to those of the samples, and the variance of the field that it
    leaves as a share of what the samples have as they are. Where nothing is better it is none, and 1.
    """
    down = _down_axis(q)
    as_told = _scatter(down, measured)
    best = min(QUARTER_TURNS, key=lambda turn: _scatter(down, measured @ turn))
    least = _scatter(down, measured @ best)
    if not least < as_told:
        return np.eye(3), 1.0
    return best, least / as_told


def _down_axis(q: np.ndarray) -> np.ndarray:
    """The axis that points down, in the body (N, 3): the last row of the rotation to NED."""
    w, x, y, z = q.T
    return np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)


def _scatter(down: np.ndarray, field: np.ndarray) -> float:
    """Variance of the field's part that points down and of the length of its level part, Gauss²."""
    vertical = np.sum(down * field, axis=1)
    level = np.sqrt(np.maximum(np.sum(field * field, axis=1) - vertical**2, 0.0))
    return float(np.var(vertical) + np.var(level))


def described(mounting: np.ndarray) -> str:
    """Angles of a rotation by quarter turns, in PX4's order of its rotation names."""
    m = np.round(mounting)
    pitch = np.arcsin(-m[2, 0])
    if m[2, 0] == 0.0:
        roll, yaw = np.arctan2(m[2, 1], m[2, 2]), np.arctan2(m[1, 0], m[0, 0])
    else:
        # nose up or down, roll and yaw turn about the same axis
        roll, yaw = 0.0, np.arctan2(-m[0, 1], m[1, 1])
    angles = {"roll": roll, "pitch": pitch, "yaw": yaw}
    degrees = {name: round(float(np.degrees(angle))) % 360 for name, angle in angles.items()}
    parts = [f"{name} {angle}°" for name, angle in degrees.items() if angle]
    return ", ".join(parts) or "nothing"


def _together(table: TopicTable, attitude: TopicTable) -> tuple[np.ndarray, np.ndarray]:
    """Attitudes (N, 4) and samples (N, 3) at the times of some evenly chosen samples."""
    sampled = table.get("timestamp_sample", table["timestamp"]).astype(np.int64)
    logged = attitude["timestamp"].astype(np.int64)
    q = stacked(attitude, "q").astype(np.float64)
    good = np.abs(np.linalg.norm(q, axis=1) - 1.0) < 0.1
    logged, q = logged[good], q[good]
    order = np.argsort(logged, kind="stable")
    logged, q = logged[order], q[order]
    if len(logged) < 2:
        return np.zeros((0, 4)), np.zeros((0, 3))
    rows = np.flatnonzero((sampled >= logged[0]) & (sampled <= logged[-1]))
    rows = rows[:: max(-(-len(rows) // MAX_SAMPLES), 1)]
    measured = stacked(table, "magnetometer_ga")[rows].astype(np.float64)
    # q and -q are one attitude: the sign that changes least is the one to interpolate
    flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
    q[1:] *= flips[:, None]
    between = np.stack([np.interp(sampled[rows], logged, q[:, i]) for i in range(4)], axis=1)
    norm = np.linalg.norm(between, axis=1)
    usable = (norm > 0.5) & np.isfinite(measured).all(axis=1)
    return between[usable] / norm[usable, None], measured[usable]
