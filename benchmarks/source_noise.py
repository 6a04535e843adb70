"""Does the interval of a source's noise hold the truth? Of simulated flights, those of the decision study's worlds, it
is known.

    python -m benchmarks.source_noise [--flights 10] [--folder build/source_noise]

Prints for each world and source what PX4 is told, the true size of the error, the estimate and the value that a filter
would want over all flights, and how often intervals of drawn studies of one, three and five flights held the truth.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from benchmarks.decision_study.collect import FIRST_SEED, StudyFiles, vehicle_of

from fusetune.analyze.replaying.replay_flight import replay_saved_flight
from fusetune.analyze.replaying.settings import ReplaySettings, WithholdingSettings
from fusetune.analyze.scoring.score_flight import score_saved_flight
from fusetune.analyze.sensors.source_whiteness import horizon_s
from fusetune.apply.consistency import SourceNoise, source_noises
from fusetune.apply.settings import DecisionSettings
from fusetune.design.missions.mission import load_mission
from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache
from fusetune.execute import simulate
from fusetune.execute.vehicle import GnssError, Vehicle
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.save import save_log
from fusetune.set_names import PRESENT
from fusetune.storage.documents import read_document
from fusetune.storage.parquet import read_table

STUDY_SIZES = (1, 3, 5)
DRAWS = 100


def true_size(vehicle: Vehicle, source: str) -> float | None:
    """What the estimate stands for: white noise and what wanders within the horizon, mean over the axes as it is."""
    gnss, barometer, horizon = vehicle.gnss, vehicle.barometer, horizon_s(source)
    if source == "gnss_vel":
        vertical = gnss.velocity.vertical_factor / AXIS_RATIO
        return _size(gnss.velocity, horizon) * vertical ** (1.0 / 3.0)
    if source == "gnss_pos":
        return _size(gnss.position, horizon)
    if source == "gnss_hgt":
        return _size(gnss.position, horizon) * gnss.position.vertical_factor
    if source == "baro_hgt":
        return _joined(barometer.noise_m, barometer.drift_m, barometer.drift_time_s, horizon)
    return vehicle.magnetometer.noise_gauss if source == "mag" else None


AXIS_RATIO = 1.5
"""Of the noise that PX4 takes for the vertical velocity to that of the horizontal one."""


def _size(error: GnssError, horizon: float) -> float:
    return _joined(error.noise, error.correlated, error.correlation_time_s, horizon)


def _joined(white: float, wander: float, time_s: float, horizon: float) -> float:
    return math.sqrt(white**2 + wander**2 * -math.expm1(-horizon / time_s))


def fly(world: str, number: int, target: Path, files: StudyFiles) -> None:
    """Fly and score one flight with what flies now."""
    if (target / "metrics.parquet").is_file():
        return
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        log, saved = Path(scratch, "flight.ulg"), Path(scratch, "saved")
        vehicle = vehicle_of(files.worlds_by_name()[world])
        simulate(load_mission(files.mission), vehicle, {}, FIRST_SEED + number, (), log)
        save_log(log, saved)
        settings = ReplaySettings(withholding=WithholdingSettings(gnss_s=0.0, baro_s=0.0, mag_s=0.0))
        replay_saved_flight(saved, {PRESENT: {}}, target, settings)
        score_saved_flight(saved, target, [PRESENT], present=PRESENT)


def noises_of(folders: Sequence[Path]) -> dict[str, SourceNoise]:
    """Noise of every source, from scored flights."""
    metrics = pa.concat_tables([read_table(folder / "metrics.parquet") for folder in folders])
    # the flights of a world bear one name
    names = np.repeat([str(folder) for folder in folders], [read_rows(folder) for folder in folders])
    metrics = metrics.set_column(0, "flight", pa.array(names))
    parameters = read_document(folders[0] / "scoring.json")["sets"][PRESENT]["parameters"]
    return {one.source: one for one in source_noises(metrics, PRESENT, parameters, DecisionSettings())}


def read_rows(folder: Path) -> int:
    """Number of figures of a flight."""
    return read_table(folder / "metrics.parquet").num_rows


def main() -> None:
    """Fly, estimate, and print the table."""
    arguments = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    arguments.add_argument("--flights", type=int, default=10)
    arguments.add_argument("--folder", type=Path, default=Path("build/source_noise"))
    options = arguments.parse_args()
    use_kernel_cache()
    files, rng = StudyFiles(), np.random.default_rng(1)
    sizes = [size for size in STUDY_SIZES if size <= options.flights]
    print(
        "| world | source | told | true size | estimate | interval | a filter may want | held, "
        + " | ".join(map(str, sizes))
        + " |"
    )
    print("|---" * (7 + len(sizes)) + "|")
    for world, document in files.worlds_by_name().items():
        folders = [options.folder / world / f"flight_{number:02}" for number in range(options.flights)]
        for number, folder in enumerate(folders):
            fly(world, number, folder, files)
        vehicle = vehicle_of(document)
        hits: dict[str, dict[int, list[bool]]] = {}
        for size in sizes:
            for _ in range(DRAWS):
                drawn = noises_of([folders[k] for k in rng.choice(len(folders), size, replace=False)])
                for source, one in drawn.items():
                    truth = true_size(vehicle, source)
                    if truth is not None:
                        held = one.lower <= truth <= one.upper
                        hits.setdefault(source, {}).setdefault(size, []).append(held)
        for source, one in noises_of(folders).items():
            if source in hits:
                held = " | ".join(f"{np.mean(hits[source][size]):.0%}" for size in sizes)
                print(
                    f"| {world} | {AID_SOURCES[source].label} | {one.told:.3g} | {true_size(vehicle, source):.3g} | "
                    f"{one.size:.3g} | {one.lower:.3g} to {one.upper:.3g} | {one.wanted:.3g} | {held} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
