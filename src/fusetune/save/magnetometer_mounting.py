"""Whether the magnetometer turns as the vehicle does.

The earth's field stands still while the vehicle tilts and turns. If samples only show that with their axes taken for
others, the sensor is mounted otherwise than its parameters say.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from fusetune.px4.flight import Flight, TopicTable, stacked
from fusetune.save.verdict import Check, VerdictThresholds

MIN_SAMPLES, MAX_SAMPLES = 24, 500
MAX_SCATTER_LEFT = 0.1
"""Share of the field's variance that may be left; of sensors that are mounted as told nearly all is."""

_REMEDY = "Compare CAL_MAG0_ROT (and SENS_BOARD_ROT) with how the sensor sits; in a simulation, ask its sensor model"


def magnetometer_mounting(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the field stands still over the ground, or would if the sensor were turned."""
    name, threshold = "magnetometer_mounting", limits.max_field_scatter_left
    table, attitude = flight.topic("vehicle_magnetometer"), flight.topic("vehicle_attitude")
    if table is None or attitude is None or "q[0]" not in attitude or "magnetometer_ga[0]" not in table:
        return Check(name, "does-not-apply", "without magnetometer or attitude the two cannot be compared")
    q, measured = _together(table, attitude)
    if len(measured) < MIN_SAMPLES:
        return Check(name, "does-not-apply", f"only {len(measured)} magnetometer samples with an attitude")
    mounting, left = stillest_mounting(q, measured)
    if left > threshold:
        return Check(name, "pass", "no other mounting would make the field stand stiller", "", left, threshold)
    reason = f"the field turns as if the magnetometer sat otherwise, by {described(mounting)}"
    return Check(name, "warning", reason, _REMEDY, left, threshold)


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
    turns = np.round(Rotation.create_group("O").as_matrix())
    to_earth = Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix()
    fields = [np.einsum("nij,nj->ni", to_earth, measured @ turn) for turn in turns]
    scatter = np.array([np.var(field[:, 2]) + np.var(np.hypot(field[:, 0], field[:, 1])) for field in fields])
    as_told = scatter[np.argmax(np.trace(turns, axis1=1, axis2=2))]
    best = int(np.argmin(scatter))
    if not scatter[best] < as_told:
        return np.eye(3), 1.0
    return turns[best], max(float(scatter[best] / as_told), 0.0)


def described(mounting: np.ndarray) -> str:
    """Angles of a rotation in PX4's order of its rotation names."""
    with_lock = Rotation.from_matrix(mounting).as_euler("ZYX", degrees=True, suppress_warnings=True)
    yaw, pitch, roll = (round(float(angle)) % 360 for angle in with_lock)
    parts = [f"{name} {angle}°" for name, angle in (("roll", roll), ("pitch", pitch), ("yaw", yaw)) if angle]
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
