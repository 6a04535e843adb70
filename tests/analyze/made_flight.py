"""Flights made for tests: files as the save room and the replay write them, with innovations of known statistics."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
from tests.analyze.made_gaps import UNITS, gap_starts, write_gaps

from fusetune.ekf2.filter.common import state
from fusetune.px4.flight import Flight, ParameterHistory
from fusetune.save.flight_folder import write_flight
from fusetune.storage.documents import write_document
from fusetune.storage.parquet import write_table

START_US = 10_000_000
TAKE_OFF_S = 10.0
LANDING_S = 70.0
END_S = 75.0
AIDING_S = 5.0
GNSS_PERIOD_S = 0.2
PARAMETERS = {
    "EKF2_GPS_V_GATE": 5.0,
    "EKF2_GPS_P_GATE": 5.0,
    "EKF2_BARO_GATE": 5.0,
    "EKF2_GPS_DELAY": 110.0,
    "EKF2_BARO_DELAY": 0.0,
    "EKF2_GPS_V_NOISE": 0.3,
    "EKF2_GPS_P_NOISE": 0.5,
    "EKF2_ACC_NOISE": 0.35,
    "EKF2_GYR_NOISE": 0.015,
}

_AXES = (
    ("gnss_vel", 0, 1.0),
    ("gnss_vel", 1, 1.0),
    ("gnss_vel", 2, 1.5),
    ("gnss_pos", 0, 2.0),
    ("gnss_pos", 1, 2.0),
    ("baro_hgt", 0, 4.0),
)
"""Source, axis, and how much larger its innovations are than those of the horizontal velocity."""


@dataclass
class MadeSet:
    """A parameter set's replay.

    `error` is the standard deviation of its GNSS velocity innovations, `claimed` the one that it claims; `own` the
    share of the innovations that is its own noise, the rest being common to all sets of the flight. `drift` is the
    standard deviation of its velocity error after 9 s without GNSS, m/s, ten times `error` where not given. Each reset
    moves its position by `jump_m` to the north.
    """

    error: float = 0.1
    claimed: float = 0.3
    own: float = 0.3
    overrides: dict[str, float] = field(default_factory=dict)
    resets_s: tuple[float, ...] = ()
    aiding_s: float = AIDING_S
    status: str = "ok"
    fault_flags: int = 0
    lost_gnss_s: float | None = None
    drift: float | None = None
    jump_m: float = 3.0


def at(seconds: float) -> int:
    """Time in µs of a time in seconds since the log began."""
    return START_US + round(seconds * 1e6)


def make_flight(
    root: Path, name: str, sets: dict[str, MadeSet], seed: int = 0, *, landing_s: float = LANDING_S, truth: bool = False
) -> tuple[Path, Path]:
    """Write one flight and the replays of its sets.

    Returns
    -------
    Folder of the saved flight and folder of the replays
    """
    save, analyze = root / "save" / name, root / "analyze" / name
    save.mkdir(parents=True)
    analyze.mkdir(parents=True)
    write_flight(save, _flight(name, landing_s, truth))
    generator = np.random.default_rng(seed)
    time = START_US + np.arange(round(END_S / GNSS_PERIOD_S), dtype=np.int64) * round(GNSS_PERIOD_S * 1e6)
    common = generator.standard_normal((6, time.size))
    gap_generator = np.random.default_rng([seed, 1])
    gap_shape = (UNITS, gap_starts("gnss").size)
    common_gaps = gap_generator.standard_normal(gap_shape)
    for set_name, made in sets.items():
        own = generator.standard_normal((6, time.size))
        unit = np.sqrt(1.0 - made.own**2) * common + made.own * own
        write_set(analyze, set_name, made, time, unit)
        share = np.sqrt(1.0 - made.own**2)
        gap_unit = share * common_gaps + made.own * gap_generator.standard_normal(gap_shape)
        drift = 10.0 * made.error if made.drift is None else made.drift
        write_gaps(analyze, set_name, drift, gap_unit, START_US, true_position)
    return save, analyze


def write_set(folder: Path, name: str, made: MadeSet, time: np.ndarray, unit: np.ndarray) -> None:
    """Write the replay of one set; `unit` (6, N) are standard normal values for its innovations."""
    parameters = PARAMETERS | made.overrides
    columns: dict[str, list] = {
        key: [] for key in ("source", "axis", "timestamp_sample", "observation", "innovation", "variance", "fused")
    }
    for row, (source, axis, scale) in enumerate(_AXES):
        delay = parameters["EKF2_BARO_DELAY"] if source == "baro_hgt" else parameters["EKF2_GPS_DELAY"]
        columns["source"] += [source] * time.size
        columns["axis"] += [axis] * time.size
        columns["timestamp_sample"].append(time - round(delay * 1e3))
        columns["innovation"].append(scale * made.error * unit[row])
        # The state stays what the prediction was: no correction, so the errors are as white as the innovations.
        predicted = 2.0 if (source, axis) == ("gnss_vel", 0) else 0.0
        columns["observation"].append(predicted - columns["innovation"][-1])
        columns["variance"].append(np.full(time.size, (scale * made.claimed) ** 2))
        columns["fused"].append(time >= at(made.aiding_s))
    innovation, variance = np.concatenate(columns["innovation"]), np.concatenate(columns["variance"])
    ratio = innovation**2 / (25.0 * variance)
    table = pa.table(
        {
            "source": pa.array(columns["source"]).dictionary_encode(),
            "axis": pa.array(columns["axis"], pa.int32()),
            "timestamp_sample": np.concatenate(columns["timestamp_sample"]),
            "observation": np.concatenate(columns["observation"]),
            "observation_variance": variance,
            "innovation": innovation,
            "innovation_variance": variance,
            "test_ratio": ratio,
            "innovation_rejected": ratio > 1.0,
            "fused": np.concatenate(columns["fused"]) & (ratio <= 1.0),
        }
    )
    write_table(table, folder / f"{name}.innovations.parquet")
    write_table(_local_position(made), folder / f"{name}.local_position.parquet")
    write_table(_states(), folder / f"{name}.states.parquet")
    write_table(_flags(made), folder / f"{name}.status_flags.parquet")
    summary = {
        "set": name,
        "overrides": made.overrides,
        "params": parameters,
        "status": made.status,
        "reason": "" if made.status == "ok" else "the covariance is not finite",
        "filter_fault_flags_max": made.fault_flags,
    }
    write_document(folder / f"{name}.json", summary)


def true_position(time_us: np.ndarray) -> np.ndarray:
    """A straight flight to the north at 2 m/s, (N, 3), m."""
    seconds = (time_us - START_US) * 1e-6
    return np.column_stack([2.0 * seconds, np.zeros_like(seconds), np.full_like(seconds, -10.0)])


def _flight(name: str, landing_s: float, truth: bool) -> Flight:
    imu = START_US + np.arange(round(END_S * 200), dtype=np.int64) * 5000
    land = START_US + np.arange(round(END_S * 10), dtype=np.int64) * 100_000
    gnss = START_US + np.arange(round(END_S * 5), dtype=np.int64) * 200_000
    topics = {
        ("sensor_combined", 0): {"timestamp": imu},
        ("vehicle_land_detected", 0): {
            "timestamp": land,
            "landed": ((land < at(TAKE_OFF_S)) | (land >= at(landing_s))).astype(np.uint8),
        },
        ("vehicle_gps_position", 0): {
            "timestamp": gnss,
            "eph": np.full(gnss.size, 0.9, dtype=np.float32),
            "s_variance_m_s": np.full(gnss.size, 0.2, dtype=np.float32),
        },
    }
    if truth:
        position = true_position(land).astype(np.float32)
        topics["vehicle_local_position_groundtruth", 0] = {
            "timestamp": land,
            **{axis: position[:, i] for i, axis in enumerate("xyz")},
            **{
                f"v{axis}": np.full(land.size, value, dtype=np.float32)
                for axis, value in zip("xyz", (2, 0, 0), strict=True)
            },
        }
        quaternion = {f"q[{i}]": np.full(land.size, float(i == 0), dtype=np.float32) for i in range(4)}
        topics["vehicle_attitude_groundtruth", 0] = {"timestamp": land, **quaternion}
    return Flight(
        name=name,
        topics=topics,
        parameters=ParameterHistory(initial=dict(PARAMETERS)),
        info={"ver_sw_release": 0x011000FF},
        start_timestamp=START_US,
        last_timestamp=at(END_S),
        checksum="ab" * 32,
    )


def _output_time() -> np.ndarray:
    return START_US + np.arange(round(END_S * 10), dtype=np.int64) * 100_000


def _local_position(made: MadeSet) -> pa.Table:
    time = _output_time()
    counter = sum((time >= at(second)).astype(np.int32) for second in made.resets_s) + np.zeros(time.size, np.int32)
    position = true_position(time) + np.outer(made.jump_m * counter, [1.0, 0.0, 0.0])
    return pa.table(
        {
            "timestamp": time,
            # The output holds at `timestamp`; the fusion horizon lags behind it.
            "timestamp_sample": time - 200_000,
            **{axis: position[:, i] for i, axis in enumerate("xyz")},
            "vx": np.full(time.size, 2.0 + made.error),
            "vy": np.zeros(time.size),
            "vz": np.zeros(time.size),
            "heading": np.zeros(time.size),
            "xy_reset_counter": counter,
            **{f"{kind}_reset_counter": np.zeros(time.size, np.int32) for kind in ("z", "vxy", "vz", "heading")},
            "xy_valid": np.ones(time.size, bool),
            **{f"q_{part}": np.full(time.size, float(part == 0)) for part in range(4)},
        }
    )


def _states() -> pa.Table:
    time = _output_time()
    columns = {f"states_{i}": np.full(time.size, float(i == 0)) for i in range(state.PUBLISHED_STATE_SIZE)}
    columns["states_4"] = np.full(time.size, 2.0)
    columns |= {f"covariances_{i}": np.full(time.size, 0.01) for i in range(state.ERROR_STATE_SIZE)}
    return pa.table({"timestamp": time, "timestamp_sample": time, **columns})


def _flags(made: MadeSet) -> pa.Table:
    times, gnss = [at(0.0), at(made.aiding_s)], [False, True]
    if made.lost_gnss_s is not None:
        times += [at(made.lost_gnss_s), at(made.lost_gnss_s + 2.0)]
        gnss += [False, True]
    return pa.table(
        {
            "timestamp": np.array(times, dtype=np.int64),
            "cs_gnss_pos": gnss,
            "cs_inertial_dead_reckoning": [not on for on in gnss],
            "fs_bad_hdg": [bool(made.fault_flags)] * len(times),
        }
    )
