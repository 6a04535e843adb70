"""Gaps without a sensor for made flights: predictions of known drift, in the tables that the replay writes of them."""

from pathlib import Path

import numpy as np
import pyarrow as pa

from fusetune.storage.parquet import write_table

GAP_S = 9.0
HORIZONS_S = (3.0, 6.0, 9.0)
EVERY_S = {"gnss": 3.0, "baro": 9.0}
FIRST_S, LAST_S = 12.0, 70.0

_ROWS = (
    ("gnss", "gnss_vel", 0, 1.0),
    ("gnss", "gnss_vel", 1, 1.0),
    ("gnss", "gnss_vel", 2, 1.5),
    ("gnss", "gnss_pos", 0, 4.5),
    ("gnss", "gnss_pos", 1, 4.5),
    ("baro", "baro_hgt", 0, 0.5),
)
"""Sensor, source, axis, and standard deviation of its error after 9 s in units of the set's drift."""

UNITS = len(_ROWS)


def gap_starts(sensor: str) -> np.ndarray:
    """Starts of the gaps, s since the log began."""
    return np.arange(FIRST_S, LAST_S - GAP_S + 1e-6, EVERY_S[sensor])


def expected_drift(source: str, axis: int, drift: float, horizon_s: float) -> float:
    """Standard deviation of the made error of a source: it grows with time, that of the position with its square."""
    scale = next(row[3] for row in _ROWS if row[1:3] == (source, axis))
    return scale * drift * (horizon_s / GAP_S) ** (2 if source == "gnss_pos" else 1)


def write_gaps(folder: Path, name: str, drift: float, unit: np.ndarray, start_us: int, true_position) -> None:
    """Write `<name>.withheld.parquet` and `<name>.gaps.parquet`.

    Parameters
    ----------
    drift : standard deviation of the horizontal velocity error after 9 s without GNSS, m/s
    unit : (UNITS, G) standard normal values, G as many as the most frequent gaps
    true_position : of times in µs, (N, 3), NED, m; the velocity is 2 m/s to the north
    """
    starts = {sensor: gap_starts(sensor) for sensor in EVERY_S}
    first = {"gnss": 0, "baro": starts["gnss"].size}
    columns: dict[str, list] = {key: [] for key in ("sensor", "source", "gap", "start", "axis", "horizon_s", "error")}
    for row, (sensor, source, axis, _) in enumerate(_ROWS):
        count = starts[sensor].size
        for horizon in HORIZONS_S:
            columns["sensor"] += [sensor] * count
            columns["source"] += [source] * count
            columns["gap"].append(first[sensor] + np.arange(count))
            columns["start"].append(start_us + np.rint(starts[sensor] * 1e6).astype(np.int64))
            columns["axis"].append(np.full(count, axis))
            columns["horizon_s"].append(np.full(count, horizon))
            columns["error"].append(expected_drift(source, axis, drift, horizon) * unit[row, :count])
    start, error = np.concatenate(columns["start"]), np.concatenate(columns["error"])
    predictions = {
        "sensor": pa.array(columns["sensor"]),
        "source": pa.array(columns["source"]).dictionary_encode(),
        "gap": np.concatenate(columns["gap"]).astype(np.int32),
        "start": start,
        "stop": start + round(GAP_S * 1e6),
        "axis": np.concatenate(columns["axis"]).astype(np.int32),
        "horizon_s": np.concatenate(columns["horizon_s"]),
        "n": np.full(error.size, 5, np.int32),
        "innovation": error,
        "innovation_variance": np.full(error.size, drift**2),
    }
    write_table(pa.table(predictions), folder / f"{name}.withheld.parquet")
    write_table(_ends(starts["gnss"], drift, unit, start_us, true_position), folder / f"{name}.gaps.parquet")


def _ends(starts_s: np.ndarray, drift: float, unit: np.ndarray, start_us: int, true_position) -> pa.Table:
    start = start_us + np.rint(starts_s * 1e6).astype(np.int64)
    stop = start + round(GAP_S * 1e6)
    columns = {"sensor": pa.array(["gnss"] * start.size), "start": start, "stop": stop}
    for moment, time, size in (("begin", start, 0.0), ("end", stop, 1.0)):
        position = true_position(time)
        columns[f"timestamp_{moment}"] = time
        for axis, letter in enumerate("xyz"):
            row = 3 + axis
            error = size * expected_drift("gnss_pos", axis, drift, GAP_S) * unit[row] if axis < 2 else 0.0
            columns[f"{letter}_{moment}"] = position[:, axis] + error
        for axis, letter in enumerate("xyz"):
            error = size * expected_drift("gnss_vel", axis, drift, GAP_S) * unit[axis]
            columns[f"v{letter}_{moment}"] = (2.0 if axis == 0 else 0.0) + error
    return pa.table(columns)
