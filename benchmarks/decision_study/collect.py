"""Fly every world's vehicle, replay every set on every flight, and keep what the decision and the judge read."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from fusetune.analyze.replaying.replay_flight import replay_saved_flight
from fusetune.analyze.replaying.settings import ReplaySettings, WithholdingSettings
from fusetune.analyze.scoring.score_flight import score_saved_flight
from fusetune.design.mission import load_mission
from fusetune.design.study import load_study
from fusetune.execute import simulate
from fusetune.execute.vehicle import Vehicle, load_vehicle
from fusetune.save import save_log
from fusetune.set_names import PRESENT
from fusetune.storage.digest import source_digest

HERE = Path(__file__).parent
KEPT = ("scoring.json", "scores.parquet", "withheld.parquet", "smoothed.parquet", "metrics.parquet")
FIRST_SEED = 1000


@dataclass(frozen=True)
class StudyFiles:
    """What the study is made of."""

    worlds: Path = HERE / "worlds.yaml"
    sets: Path = HERE / "sets.yaml"
    mission: Path = HERE / "mission.yaml"

    def worlds_by_name(self) -> dict[str, dict[str, Any]]:
        """Description, vehicle file and changes of every world."""
        return yaml.safe_load(self.worlds.read_text(encoding="utf-8"))

    def overrides(self) -> dict[str, dict[str, float]]:
        """Parameters of every set; the present one has none, so the defaults."""
        return {PRESENT: {}} | {one.name: dict(one.overrides) for one in load_study(self.sets).sets}


def merged(base: Any, changes: Any) -> Any:
    """Mappings within mappings with some values changed."""
    if not isinstance(base, Mapping) or not isinstance(changes, Mapping):
        return changes
    return {**base, **{name: merged(base.get(name), value) for name, value in changes.items()}}


def vehicle_of(world: Mapping[str, Any]) -> Vehicle:
    """The vehicle of a world, checked like any other vehicle file."""
    document = yaml.safe_load(Path(world["vehicle"]).read_text(encoding="utf-8"))
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", encoding="utf-8") as file:
        yaml.safe_dump(merged(document, world.get("changes", {})), file)
        file.flush()
        return load_vehicle(file.name)


def collect(files: StudyFiles, flights: int, folder: Path, workers: int) -> dict[str, list[Path]]:
    """Folders of the scored flights of every world; flights that are there from the same sources are kept.

    Parameters
    ----------
    flights : number of flights per world
    folder : takes `<world>/<flight>`
    """
    jobs = {
        world: [folder / world / f"flight_{number:02}" for number in range(flights)] for world in files.worlds_by_name()
    }
    with ProcessPoolExecutor(workers) as pool:
        running = [
            pool.submit(_fly_and_score, files, world, FIRST_SEED + number, target)
            for number in range(flights)
            for world, target in ((world, targets[number]) for world, targets in jobs.items())
        ]
        for job in running:
            print(job.result(), flush=True)
    return jobs


def _fly_and_score(files: StudyFiles, world: str, seed: int, target: Path) -> str:
    stamp = target / "made_from"
    key = source_digest("px4", "ekf2", "design", "execute", "save", "analyze") + "".join(
        file.read_text(encoding="utf-8") for file in (files.worlds, files.sets, files.mission)
    )
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == key:
        return f"{target}: there"
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    sets = files.overrides()
    with tempfile.TemporaryDirectory() as scratch:
        log, saved, analyzed = Path(scratch, f"{target.name}.ulg"), Path(scratch, "saved"), Path(scratch, "analyzed")
        vehicle = vehicle_of(files.worlds_by_name()[world])
        simulate(load_mission(files.mission), vehicle, {}, seed, (), log)
        save_log(log, saved)
        # Only gaps without GNSS decide; the others would cost as much again.
        settings = ReplaySettings(withholding=WithholdingSettings(baro_s=0.0, mag_s=0.0))
        replay_saved_flight(saved, sets, analyzed, settings)
        score_saved_flight(saved, analyzed, list(sets), present=PRESENT)
        for name in KEPT:
            shutil.copy(analyzed / name, target / name)
    stamp.write_text(key, encoding="utf-8")
    return f"{target}: flown and scored"
