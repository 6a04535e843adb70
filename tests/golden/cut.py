"""Cut the golden flights out of made logs and of what PX4 v1.16's own EKF2 computes on them.

    python -m tests.golden.cut

reads `../shared` (or the folder that FUSETUNE_SHARED names) and writes `logs/` and `reference/` beside this file. The
filter is causal: what PX4 computed up to the cut does not depend on what came after it. Equal input gives equal bytes
as long as liblzma and PyArrow are the same; with others the content is equal.
"""

from __future__ import annotations

import lzma
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
from benchmarks.reference_flights import GOLDEN
from tests.shared_folder import SHARED

from fusetune.px4.flight import Flight, TopicTable, select_rows
from fusetune.px4.ulog.reader import read_ulog
from fusetune.px4.ulog.writer import write_ulog
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import atomic_path
from fusetune.storage.parquet import read_table, write_table

MADE = "synthetic__"
"""What the names of the made logs begin with."""


@dataclass(frozen=True)
class GoldenFlight:
    """A made flight and what is kept of it."""

    name: str
    until_us: int
    """Time of the last message, µs since boot."""
    sets: tuple[str, ...]
    """Parameter sets of the reference: `asflown`, or one that differs from what flew."""


GOLDEN_FLIGHTS = (
    GoldenFlight("fw_airspeed", 41_500_000, ("asflown",)),
    GoldenFlight("mc_drag", 36_500_000, ("aid",)),
    GoldenFlight("mc_flow", 45_900_000, ("aid",)),
    GoldenFlight("mc_gnss_yaw", 36_500_000, ("paper5",)),
    GoldenFlight("mc_vision", 36_500_000, ("aid",)),
)

LAST_MOMENTS_US = 500_000
"""A sample reaches the filter up to EKF2_DELAY_MAX (200 ms) after it was measured: PX4 had those after the cut, too."""

FIELDS = {
    "sensor_combined": (
        "gyro_rad", "gyro_integral_dt", "gyro_calibration_count", "accelerometer_m_s2", "accelerometer_integral_dt",
        "accelerometer_clipping", "accel_calibration_count",
    ),
    "vehicle_air_data": ("timestamp_sample", "baro_device_id", "baro_alt_meter", "rho", "calibration_count"),
    "vehicle_gps_position": (
        "latitude_deg", "longitude_deg", "altitude_msl_m", "s_variance_m_s", "eph", "epv", "hdop", "vdop",
        "vel_n_m_s", "vel_e_m_s", "vel_d_m_s", "vel_ned_valid", "heading", "heading_offset", "heading_accuracy",
        "fix_type", "spoofing_state", "satellites_used",
    ),
    "vehicle_magnetometer": ("timestamp_sample", "device_id", "magnetometer_ga", "calibration_count"),
    "vehicle_land_detected": ("landed", "in_ground_effect", "at_rest"),
    "vehicle_status": ("arming_state", "vehicle_type"),
    "airspeed_validated": ("calibrated_airspeed_m_s", "true_airspeed_m_s", "airspeed_source"),
    "distance_sensor": ("min_distance", "max_distance", "current_distance", "signal_quality", "orientation"),
    "vehicle_optical_flow": (
        "timestamp_sample", "pixel_flow", "delta_angle", "distance_m", "integration_timespan_us", "quality",
        "max_flow_rate", "min_ground_distance", "max_ground_distance",
    ),
    "vehicle_visual_odometry": (
        "timestamp_sample", "position", "q", "velocity", "position_variance", "orientation_variance",
        "velocity_variance", "pose_frame", "velocity_frame", "reset_counter", "quality",
    ),
}  # fmt: skip
"""Topics and fields that the replay reads of a made flight; of an array all its elements."""


def main() -> None:
    cut_all(SHARED / "logs", SHARED / "reference", GOLDEN)


def cut_all(logs: Path, reference: Path, golden: Path) -> None:
    """Cut every flight of `GOLDEN_FLIGHTS`; `logs` and `reference` are the folders of the made flights."""
    for flight in GOLDEN_FLIGHTS:
        log = cut_log(read_ulog(logs / f"{MADE}{flight.name}.ulg"), flight.until_us)
        _write_packed(golden / "logs" / f"{flight.name}.ulg.xz", log)
        for name in flight.sets:
            cut_reference(reference / f"{MADE}{flight.name}", name, flight.until_us, golden / "reference" / flight.name)


def cut_log(flight: Flight, until_us: int) -> Flight:
    """The messages up to a time, with the topics and fields of `FIELDS` alone."""
    topics = {
        (topic, instance): select_rows(_fields(table, FIELDS[topic]), table["timestamp"] <= until_us)
        for (topic, instance), table in flight.topics.items()
        if topic in FIELDS
    }
    return flight.with_topics(topics)


def _fields(table: TopicTable, fields: tuple[str, ...]) -> TopicTable:
    kept = {"timestamp", *fields}
    return {column: values for column, values in table.items() if column.partition("[")[0] in kept}


def _write_packed(target: Path, log: Flight) -> None:
    with tempfile.TemporaryDirectory() as scratch, atomic_path(target) as path:
        write_ulog(Path(scratch) / "log.ulg", log)
        content = (Path(scratch) / "log.ulg").read_bytes()
        path.write_bytes(lzma.compress(content, preset=9 | lzma.PRESET_EXTREME))


def cut_reference(reference: Path, name: str, until_us: int, target: Path) -> None:
    """What PX4 computed with one set up to a time, without what the comparison does not read."""
    last_us = until_us - LAST_MOMENTS_US
    innovations = _rows_until(reference / f"{name}.innovations.parquet", "timestamp_sample", last_us)
    _write(innovations.drop_columns(["observation", "observation_variance"]), target / f"{name}.innovations.parquet")
    states = _rows_until(reference / f"{name}.states.parquet", "timestamp_sample", last_us)
    _write(_chosen(states, "states_"), target / f"{name}.states.parquet")
    flags = _rows_until(reference / f"{name}.status_flags.parquet", "timestamp", until_us)
    _write(_chosen(flags, "cs_"), target / f"{name}.status_flags.parquet")
    position = _rows_until(reference / f"{name}.local_position.parquet", "timestamp_sample", last_us)
    whole = read_document(reference / f"{name}.json", sealed=False)
    part = {key: whole[key] for key in ("version", "set", "mode", "overrides", "params")}
    with atomic_path(target / f"{name}.json") as path:
        counters = [name for name in position.column_names if name.endswith("_reset_counter")]
        resets = {counter: position[counter][-1].as_py() for counter in counters}
        write_document(path, part | {"resets": resets})


def _rows_until(path: Path, time: str, last_us: int) -> pa.Table:
    table = read_table(path, sealed=False)
    return table.filter(pc.less_equal(table[time], last_us))


def _chosen(table: pa.Table, prefix: str) -> pa.Table:
    return table.select([name for name in table.column_names if name.startswith(("timestamp", prefix))])


def _write(table: pa.Table, target: Path) -> None:
    """As small as Parquet can: the bytes of floating-point numbers apart, times as differences."""
    table = table.unify_dictionaries().combine_chunks()
    encodings = {pa.float32(): "BYTE_STREAM_SPLIT", pa.int64(): "DELTA_BINARY_PACKED"}
    with atomic_path(target) as path:
        write_table(
            table,
            path,
            compression="zstd",
            compression_level=19,
            use_dictionary=[name for name in ("source", "axis") if name in table.column_names],
            column_encoding={field.name: encodings[field.type] for field in table.schema if field.type in encodings},
            write_statistics=False,
            store_schema=False,
        )


if __name__ == "__main__":
    main()
