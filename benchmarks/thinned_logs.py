"""How near a replay of a thinned log comes to one of the whole log, and to the vehicle; printed as Markdown.

    python benchmarks/thinned_logs.py LOGS_DIR [--reference REFERENCE_DIR] > tables.md

LOGS_DIR holds ULog files; those named below are used, the others are passed over. REFERENCE_DIR holds one folder per
log with parameter sets (SET.json), whose order by NLL is compared. Three flights are simulated beside.

Full-rate logs are thinned as the default logging profile of their PX4 release thins them: IMU rows lost in short
bursts, magnetometer at 2 Hz (5 Hz before v1.12), barometer at 5 Hz, attitude at 20 Hz, velocity at 10 Hz, the
estimator's own topics at 2 Hz.
Default-profile logs are compared with what the vehicle's own estimator logged.
"""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import kendalltau

from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.reconstruction import ReconstructionSettings
from fusetune.analyze.replaying.prepared_flight import PreparedFlight, prepare
from fusetune.analyze.replaying.set_input import WRITTEN_BACK, read_set_files
from fusetune.analyze.replaying.settings import IN_USE, StartSettings
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.trust.compared_innovations import replayed_innovations
from fusetune.analyze.trust.fidelity import NLL_CAP, NLL_SOURCES
from fusetune.analyze.trust.grade import grade_flight
from fusetune.analyze.trust.grade_causes import cost_of
from fusetune.design.missions.mission import load_mission
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.execute.simulation import fly
from fusetune.execute.vehicle import load_vehicle
from fusetune.px4.flight import Flight, TopicTable, row_count, select_rows
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.complete_sets import complete
from fusetune.px4.ulog.reader import read_ulog

PROJECT = Path(__file__).resolve().parents[1]
FULL_RATE = (
    "JAParedes__TestFlight1",
    "erdemarslan380__sitl_max_80",
    "erdemarslan380__sitl_windy",
    "synthetic__mc_gnss",
)
DEFAULT_PROFILE = (
    "SkyRats__log_7_", "SkyRats__log_8_", "SkyRats__log_9_", "SkyRats__log_10_", "SkyRats__log_13_", "SkyRats__log_16_",
    "SkyRats__log_17_", "Parham-Oveissi__log_40_", "FSYR-H__log_61_", "PX4__ekf_failure",
)  # fmt: skip
GROUPS = {
    "GNSS velocity": (("gnss_vel", 0), ("gnss_vel", 1)),
    "vertical": (("gnss_vel", 2),),
    "GNSS position": (("gnss_pos", 0), ("gnss_pos", 1)),
    "magnetometer": (("mag", 0), ("mag", 1), ("mag", 2)),
    "heading alone": (("mag_heading", 0),),
}
SIMULATED_SEEDS = (1, 2, 3)
THINNING_SEEDS = (1, 2, 3)
IMU_LOST, BARO_HZ, ATTITUDE_HZ, VELOCITY_HZ, ESTIMATOR_HZ, GNSS_HZ = 0.04, 5.0, 20.0, 10.0, 2.0, 2.0
OLD_MAG_HZ, MAG_HZ, MAG_HZ_SINCE = 5.0, 2.0, (1, 12, 0)
"""The default profile's magnetometer rate before v1.12 and since."""

MEAN_BURST = 2.0
WARM_UP_S, SHORT_LOG_S, SHORT_WARM_UP_S = 20.0, 40.0, 4.0
SAME_SAMPLE_US = 8_000


@dataclass(frozen=True)
class Thinning:
    """What is taken from a full-rate log."""

    gnss: bool = False
    seed: int = 1
    other_mag_rate: bool = False
    """Magnetometer as the default profile of the releases on the other side of v1.12 logs it."""

    def mag_hz(self, release: tuple[int, int, int] | None) -> float:
        """Magnetometer rate that is left of a flight of this release."""
        recent = release is None or release >= MAG_HZ_SINCE
        return MAG_HZ if recent != self.other_mag_rate else OLD_MAG_HZ


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", type=Path)
    parser.add_argument("--reference", type=Path)
    parser.add_argument("--default-profile", action="store_true", help="only the logs of PX4's default profile")
    options = parser.parse_args()
    if options.default_profile:
        _print_vehicle(options.logs)
        return
    full_rate = list(_full_rate_flights(options.logs))
    _print_differences(full_rate)
    _print_vehicle(options.logs)
    if options.reference:
        _print_order(full_rate, options.reference)


def _full_rate_flights(logs: Path) -> Iterable[Flight]:
    for stem in FULL_RATE:
        for log in sorted(logs.glob(f"{stem}.ulg")):
            yield _with_attitude(canonical(read_ulog(log)))
    mission = load_mission(PROJECT / "config/missions/survey.yaml")
    vehicle = load_vehicle(PROJECT / "config/vehicles/quadrotor.yaml")
    for seed in SIMULATED_SEEDS:
        flight = canonical(fly(mission, vehicle, {}, seed=seed))
        flight.name = f"simulated {seed}"
        yield _with_attitude(flight)


def _with_attitude(flight: Flight) -> Flight:
    """Simulated logs without an estimator hold the true attitude only."""
    truth = flight.topic("vehicle_attitude_groundtruth")
    if flight.topic("vehicle_attitude") is not None or truth is None:
        return flight
    return flight.with_topics(flight.topics | {("vehicle_attitude", 0): truth})


def thinned(flight: Flight, thinning: Thinning) -> Flight:
    """The flight as the default profile would have logged it."""
    topics = {key: table for key, table in flight.topics.items() if key[0] != "ekf2_timestamps"}
    topics["sensor_combined", 0] = _with_bursts_lost(topics["sensor_combined", 0], thinning.seed)
    rates = {
        "vehicle_magnetometer": thinning.mag_hz(flight.release),
        "vehicle_air_data": BARO_HZ,
        "vehicle_attitude": ATTITUDE_HZ,
        "vehicle_local_position": VELOCITY_HZ,
    }
    if thinning.gnss:
        rates["vehicle_gps_position"] = GNSS_HZ
    for (topic, instance), table in topics.items():
        rate = ESTIMATOR_HZ if topic.startswith("estimator_") else rates.get(topic)
        if rate is not None:
            topics[topic, instance] = _decimated(table, rate)
    return flight.with_topics(topics)


def _with_bursts_lost(table: TopicTable, seed: int) -> TopicTable:
    random = np.random.default_rng(seed)
    rows = row_count(table)
    kept = np.ones(rows, np.bool_)
    for start in np.flatnonzero(random.random(rows) < IMU_LOST / MEAN_BURST):
        kept[start : start + random.geometric(1.0 / MEAN_BURST)] = False
    kept[[0, -1]] = True
    return select_rows(table, kept)


def _decimated(table: TopicTable, rate_hz: float) -> TopicTable:
    """Rows that a logger with this minimum interval keeps."""
    kept, last = [], -np.inf
    for row, time in enumerate(table["timestamp"].astype(np.int64).tolist()):
        if time - last >= 1e6 / rate_hz - 500:
            kept.append(row)
            last = time
    return select_rows(table, np.array(kept))


Run = tuple[ReplayResult, np.ndarray]


def _run(prepared: PreparedFlight, flight: Flight, overrides: Mapping[str, float] | None = None) -> Run:
    overrides = overrides or {}
    params = complete(flight.parameters.initial, overrides, flight.release)
    return prepared.replay(params, frozenset(overrides))


def _warm(result: ReplayResult) -> int:
    source = AID_SOURCE_NAMES.index("gnss_vel")
    rows = result.innovations[(result.innovations["source"] == source) & result.innovations["fused"]]
    span_s = float(result.states["timestamp_sample"][-1] - rows["timestamp_sample"][0]) * 1e-6
    warm_up_s = WARM_UP_S if span_s > SHORT_LOG_S else SHORT_WARM_UP_S
    return int(rows["timestamp_sample"][0] + warm_up_s * 1e6)


def difference(full: Run, other: Run, group: Iterable[tuple[str, int]], since: int) -> float:
    """RMS of the difference of measured innovations over the RMS of those of the full-rate replay."""
    squares, size = 0.0, 0.0
    for source, axis in group:
        time, reference = replayed_innovations(*full, source, axis)
        at, innovation = replayed_innovations(*other, source, axis)
        if len(time) < 2 or not len(at):
            continue
        right = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
        partner = np.where(np.abs(time[right - 1] - at) <= np.abs(time[right] - at), right - 1, right)
        same = (np.abs(time[partner] - at) <= SAME_SAMPLE_US) & (at >= since)
        squares += float(np.sum((innovation[same] - reference[partner[same]]) ** 2))
        size += float(np.sum(reference[partner[same]] ** 2))
    return float(np.sqrt(squares / size)) if size > 0.0 else float("nan")


def _print_differences(flights: list[Flight]) -> None:
    """Part (a): thinned and reconstructed against the own full-rate replay, cold start in both."""
    print("### Full-rate logs, thinned: difference of innovations to the full-rate replay, RMS over RMS\n")
    print("Median over three random losses of 4 % of the IMU rows.\n")
    print("| flight | variant | " + " | ".join(GROUPS) + " |")
    print("|---" * (2 + len(GROUPS)) + "|")
    repaired = ReconstructionSettings()
    variants: dict[str, tuple[ReconstructionSettings | None, Thinning]] = {
        "raw": (None, Thinning()),
        "reconstructed": (repaired, Thinning()),
        "reconstructed, mag rate of the other releases": (repaired, Thinning(other_mag_rate=True)),
        "reconstructed, GNSS 2 Hz too": (repaired, Thinning(gnss=True)),
    }
    collected: dict[str, list[list[float]]] = {name: [] for name in variants}
    for flight in flights:
        full = _run(prepare(flight), flight)
        since = _warm(full[0])
        for name, (settings, thinning) in variants.items():
            figures = []
            for seed in THINNING_SEEDS:
                small = thinned(flight, replace(thinning, seed=seed))
                run = _run(prepare(small, settings), small)
                figures.append([difference(full, run, group, since) for group in GROUPS.values()])
            row = [statistics.median(column) for column in zip(*figures, strict=True)]
            collected[name].append(row)
            print(f"| {flight.name} | {name} | " + " | ".join(map(_percent, row)) + " |", flush=True)
    for name, rows in collected.items():
        medians = [
            statistics.median(value for value in column if np.isfinite(value)) for column in zip(*rows, strict=True)
        ]
        print(f"| **median** | {name} | " + " | ".join(map(_percent, medians)) + " |")
    print()


def _print_vehicle(logs: Path) -> None:
    """Parts (b) and (c): default-profile logs against the vehicle, and what is lost before scoring begins."""
    print("### Default-profile logs: RMS of innovations, replay to vehicle\n")
    groups = ("horizontal_velocity", "horizontal_position", "heading", "magnetic_field")
    print(
        "| log | grade (as logged) | velocity | position | heading | field | height, m | vertical velocity, m/s | "
        "as logged: velocity | position | heading | field | costs most | of it | s lost after log start | "
        "s lost in the air |"
    )
    print("|---" * 16 + "|")
    collected: list[list[float]] = []
    for stem in DEFAULT_PROFILE:
        for log in sorted(logs.glob(f"{stem}*.ulg")):
            flight = canonical(read_ulog(log))
            grade = grade_flight(prepare(flight, IN_USE.reconstruction, IN_USE.start, release=IN_USE.release))
            sizes = [grade.repaired.innovation_ratio.get(name, float("nan")) for name in groups]
            height = (grade.repaired.height_m, grade.repaired.vertical_velocity_m_s)
            sizes += [float("nan") if value is None else value for value in height]
            raw = [grade.as_logged.innovation_ratio.get(name, float("nan")) for name in groups]
            lost = _lost_s(flight)
            collected.append([*sizes, *raw, *lost])
            open_causes = [cause for cause in grade.causes if not cause.evidence["repaired"]]
            worst = max(open_causes, key=cost_of, default=None)
            cells = [log.stem, f"{grade.grade} ({grade.as_logged_grade})", *map(_number, sizes + raw)]
            cells += [worst.found if worst else "–", _number(cost_of(worst)) if worst else "–", *map(_number, lost)]
            print("| " + " | ".join(cells) + " |", flush=True)
    if collected:
        medians = [statistics.median(v for v in column if np.isfinite(v)) for column in zip(*collected, strict=True)]
        cells = ["**median**", "", *map(_number, medians[:10]), "", "", *map(_number, medians[10:])]
        print("| " + " | ".join(cells) + " |\n")


def _lost_s(flight: Flight) -> tuple[float, float]:
    """Seconds from the log's begin, and seconds of flight, before scoring begins."""
    settings = ScoringSettings()
    prepared = prepare(flight, ReconstructionSettings(), StartSettings())
    result, _ = _run(prepared, flight)
    source = [AID_SOURCE_NAMES.index(name) for name in ("gnss_vel", "gnss_pos")]
    rows = result.innovations[np.isin(result.innovations["source"], source) & result.innovations["fused"]]
    settle_s = settings.warm_settle_s if result.warm_start_us is not None else settings.settle_s
    begin = int(rows["timestamp_sample"].min()) + round(settle_s * 1e6)
    airborne = airborne_intervals(flight, {})
    first = int(flight.topics["sensor_combined", 0]["timestamp"][0])
    return (begin - first) * 1e-6, max(begin - max(airborne[0][0], first), 0) * 1e-6


def _print_order(flights: list[Flight], reference: Path) -> None:
    """Part (d): the order of parameter sets by NLL, full-rate against thinned and reconstructed."""
    print("### Order of the reference sets by NLL, Kendall τ\n")
    print("| flight | sets | raw | reconstructed |")
    print("|---|---|---|---|")
    collected = []
    fallback = next((folder for folder in sorted(reference.iterdir()) if folder.name.startswith(FULL_RATE[0])), None)
    for flight in flights:
        folder = reference / flight.name if (reference / flight.name).is_dir() else fallback
        if folder is None:
            continue
        sets = _sets(folder)
        small = thinned(flight, Thinning())
        whole = _totals(prepare(flight), flight, sets)
        row = []
        for settings in (None, ReconstructionSettings()):
            totals = _totals(prepare(small, settings), small, sets)
            row.append(float(kendalltau(whole, totals).statistic))
        collected.append(row)
        print(f"| {flight.name} | {len(sets)} | {row[0]:.2f} | {row[1]:.2f} |", flush=True)
    medians = [statistics.median(column) for column in zip(*collected, strict=True)]
    print(f"| **median** | | {medians[0]:.2f} | {medians[1]:.2f} |")


def _sets(folder: Path) -> dict[str, dict[str, float]]:
    """Overrides of each set of a folder."""
    found = read_set_files(folder)
    return {
        name: {key: value for key, value in overrides.items() if key != WRITTEN_BACK}
        for name, (_, overrides) in found.items()
    }


def _totals(prepared: PreparedFlight, flight: Flight, sets: Mapping[str, Mapping[str, float]]) -> list[float]:
    """Sum over sources and axes of the mean capped NLL of measured samples, for each set."""
    totals = []
    since = None
    for overrides in sets.values():
        result, measured = _run(prepared, flight, overrides)
        since = _warm(result) if since is None else since
        rows = result.innovations[measured & (result.innovations["timestamp_sample"] >= since)]
        totals.append(
            sum(_mean_nll(rows, AID_SOURCE_NAMES.index(name), axis) for name in NLL_SOURCES for axis in range(3))
        )
    return totals


def _mean_nll(rows: np.ndarray, source: int, axis: int) -> float:
    chosen = rows[(rows["source"] == source) & (rows["axis"] == axis) & (rows["innovation_variance"] > 0)]
    if not len(chosen):
        return 0.0
    variance = chosen["innovation_variance"].astype(np.float64)
    nll = 0.5 * (chosen["innovation"].astype(np.float64) ** 2 / variance + np.log(2.0 * np.pi * variance))
    return float(np.minimum(nll, NLL_CAP).mean())


def _percent(value: float) -> str:
    return f"{value:.1%}" if np.isfinite(value) else "–"


def _number(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else "–"


if __name__ == "__main__":
    sys.exit(main())
