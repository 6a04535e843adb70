"""The flights on which it is measured: real logs beside the checkout, and simulated ones that are made once."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from benchmarks.speed.quantities import Lacking
from benchmarks.speed.workplace import ROOT, SHARED, Workplace

REFERENCED = (
    "PX4__gps_interference",
    "FSYR-H__log_61_2024-2-6-16-27-02",
    "SkyRats__log_8_2021-8-12-15-53-14",
    "synthetic__mc_gnss",
)
"""Logs that PX4's own estimator was measured on: three vehicles and a made flight without faults."""

MADE = "synthetic__"
SIMULATE = """
import sys
from pathlib import Path
from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache
use_kernel_cache()
from fusetune.design.missions.mission import load_mission
from fusetune.execute import simulate
from fusetune.execute.vehicle import load_vehicle
mission, vehicle, *logs = map(Path, sys.argv[1:])
mission, vehicle = load_mission(mission), load_vehicle(vehicle)
for log in logs:
    unfinished = log.with_suffix(".unfinished")
    simulate(mission, vehicle, {}, int(log.stem.rpartition("_")[2]), (), unfinished)
    unfinished.rename(log)
"""


@dataclass(frozen=True)
class ReferencedLog:
    """A log and what PX4's C++ took for it."""

    log: Path
    cpu_s_per_update: float


def referenced_logs() -> list[ReferencedLog]:
    """Logs with PX4's own figures; raises `Lacking` where there are none."""
    found = []
    for name in REFERENCED:
        log, reference = SHARED / "logs" / f"{name}.ulg", SHARED / "reference" / name / "asflown.json"
        if log.is_file() and reference.is_file():
            told = json.loads(reference.read_text(encoding="utf-8"))
            found.append(ReferencedLog(log, told["cpu_s"] / told["n_updates"]))
    if not found:
        raise Lacking(f"no reference logs in {SHARED.name}/")
    return found


def real_logs() -> dict[str, Path]:
    """The real logs beside the checkout: name → file; raises `Lacking` where there are none."""
    found = {log.stem: log for log in sorted((SHARED / "logs").glob("*.ulg")) if not log.stem.startswith(MADE)}
    if not found:
        raise Lacking(f"no logs in {SHARED.name}/")
    return found


def simulated_logs(work: Workplace, count: int) -> dict[str, Path]:
    """Simulated flights of little more than a minute, made once by the revision at hand and kept."""
    folder = work.kept / "simulated"
    folder.mkdir(parents=True, exist_ok=True)
    logs = [folder / f"flight_{number:03d}.ulg" for number in range(1, count + 1)]
    mission, vehicle = (
        str(ROOT / "config" / part) for part in ("missions/short_survey.yaml", "vehicles/quadrotor.yaml")
    )
    missing = [str(log) for log in logs if not log.is_file()]
    if missing:
        work.python(SIMULATE, mission, vehicle, *missing, tree=ROOT)
    return {log.stem: log for log in logs}


def noise_sets(count: int) -> dict[str, dict[str, float]]:
    """Sets that differ in what the filter is told of GNSS and IMU: each has a replay of its own."""
    return {
        f"set_{number}": {"EKF2_GPS_V_NOISE": 0.3 + 0.4 * number / count, "EKF2_ACC_NOISE": 0.2 + 0.3 * number / count}
        for number in range(1, count + 1)
    }


def study_of(sets: Mapping[str, Mapping[str, float]]) -> dict[str, object]:
    """A study file's content."""
    return {"name": "made", "kind": "list", "sets": [{"name": name, "parameters": dict(s)} for name, s in sets.items()]}
