"""Measure the save step: MB of log per second of CPU, and peak memory over the size of the log, as Markdown.

    python benchmarks/save_speed.py LOGS_DIR [--minutes 15 30 60] [--estimator]

Each log of the folder is saved, then simulated flights of the given lengths, laps of the survey mission. Every log has
a process of its own, which saves it three times, each time to a new folder; the fastest counts. Memory is the process's
peak over what a log of two messages takes. Simulated flights also show the time of the simulation, with the vehicle's
estimator if asked for.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RUNS = 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", type=Path)
    parser.add_argument("--minutes", type=float, nargs="*", default=[15.0, 30.0, 60.0])
    parser.add_argument("--estimator", action="store_true", help="simulate the vehicle's estimator, too")
    parser.add_argument("--measure", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        print(json.dumps(measure(options.logs, options.measure)))
        return
    print("| log | MB | topics | columns | MB/s | peak memory / log | simulated in |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        results = [row(log, Path(scratch)) for log in sorted(options.logs.glob("*.ulg"))]
        for minutes in options.minutes:
            log, seconds = simulated(Path(scratch) / f"simulated_{minutes:g}_min.ulg", minutes, options.estimator)
            row(log, Path(scratch), f"{seconds:.0f} s")
            log.unlink()
    total, cpu = sum(one["bytes"] for one in results), sum(one["cpu_s"] for one in results)
    if cpu:
        print(f"| **all logs of the folder** | {total / 1e6:.1f} | | | {total / 1e6 / cpu:.1f} | | |")


def row(log: Path, scratch: Path, simulated_in: str = "–") -> dict[str, float]:
    """Measure one log and print its line."""
    result = measured(log, scratch)
    size = result["bytes"]
    cells = (
        log.stem,
        f"{size / 1e6:.2f}",
        f"{result['topics']:.0f}",
        f"{result['columns']:.0f}",
        f"{size / 1e6 / result['cpu_s']:.1f}",
        f"{result['peak_bytes'] / size:.1f}",
        simulated_in,
    )
    print(f"| {' | '.join(cells)} |", flush=True)
    return result


def measured(log: Path, scratch: Path) -> dict[str, float]:
    """Figures of one log from a process of its own."""
    command = [sys.executable, __file__, str(log), "--measure", str(scratch)]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def measure(log: Path, scratch: Path) -> dict[str, float]:
    """Save a log; CPU time of the fastest run and peak memory of this process."""
    import numpy as np

    from fusetune.px4.flight import Flight
    from fusetune.px4.ulog.writer import write_ulog
    from fusetune.save import save_log

    # What is saved stays until the end of all: file systems are slow to make files where others were just removed.
    folder = Path(tempfile.mkdtemp(dir=scratch))
    tiny = folder / "tiny.ulg"
    write_ulog(tiny, Flight("tiny", {("vehicle_status", 0): {"timestamp": np.arange(2)}}))
    save_log(tiny, folder / "tiny")
    baseline, times = peak_bytes(), []
    for run in range(RUNS):
        begin = time.process_time()
        save_log(log, folder / f"run_{run}")
        times.append(time.process_time() - begin)
    peak = peak_bytes() - baseline
    return {"bytes": log.stat().st_size, "cpu_s": min(times), "peak_bytes": peak, **contents(folder / "run_0")}


def contents(folder: Path) -> dict[str, int]:
    """Number of topics and columns of a saved flight."""
    import pyarrow.parquet as pq

    entries = json.loads((folder / "metadata.json").read_text(encoding="utf-8")).get("topics", [])
    columns = sum(pq.read_metadata(folder / entry["file"]).num_columns for entry in entries)
    return {"topics": len(entries), "columns": columns}


def peak_bytes() -> int:
    """Peak memory of this process alone; what `getrusage` tells includes that of the process it was forked from."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return next(int(line.split()[1]) * 1024 for line in status.splitlines() if line.startswith("VmHWM"))


def simulated(log: Path, minutes: float, with_estimator: bool) -> tuple[Path, float]:
    """Write a simulated flight of about this length, laps of the survey mission; the time that took."""
    from fusetune.design.missions.mission import load_mission
    from fusetune.execute.simulation import fly
    from fusetune.execute.vehicle import load_vehicle
    from fusetune.execute.world.flight_plan import plan_flight
    from fusetune.px4.ulog.writer import write_ulog

    vehicle = load_vehicle(ROOT / "config/vehicles/quadrotor.yaml")
    mission = load_mission(ROOT / "config/missions/survey.yaml")
    once = plan_flight(mission, vehicle.limits).events
    lap = dataclasses.replace(mission, waypoints=mission.waypoints * 2)
    lap_s = plan_flight(lap, vehicle.limits).events.end_s - once.end_s
    laps = max(1, math.ceil((minutes * 60.0 - (once.end_s - lap_s)) / lap_s))
    mission = dataclasses.replace(mission, waypoints=mission.waypoints * laps)
    begin = time.perf_counter()
    write_ulog(log, fly(mission, vehicle, {}, 1, (), log.stem, with_estimator=with_estimator))
    return log, time.perf_counter() - begin


if __name__ == "__main__":
    main()
