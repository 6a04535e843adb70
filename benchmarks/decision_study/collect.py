"""Fly every world's vehicle, replay every set on every flight, and keep what the decision and the judge read."""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from fusetune.analyze.diagnose_flight import estimate_delays
from fusetune.analyze.replaying.replay_flight import replay_saved_flight
from fusetune.analyze.replaying.settings import IN_USE, ReplaySettings, WithholdingSettings
from fusetune.analyze.scoring.score_flight import score_saved_flight
from fusetune.design.missions.mission import load_mission
from fusetune.design.study import load_study
from fusetune.execute import simulate
from fusetune.execute.vehicle import Vehicle, load_vehicle
from fusetune.px4.ulog.writer import write_ulog
from fusetune.save import save_log
from fusetune.set_names import PRESENT
from fusetune.storage.digest import source_digest

from .raw_data import write_raw
from .second_simulator import fly, second_world

HERE = Path(__file__).parent
KEPT = ("delays.json", "scoring.json", "scores.parquet", "withheld.parquet", "smoothed.parquet", "metrics.parquet")
FIRST_SEED = 1000
# Only gaps without GNSS decide; the others would cost as much again.
GNSS_GAPS = WithholdingSettings(baro_s=0.0, mag_s=0.0)


@dataclass(frozen=True)
class StudyFiles:
    """What the study is made of."""

    worlds: Path = HERE / "worlds.yaml"
    sets: Path = HERE / "sets.yaml"
    mission: Path = HERE / "mission.yaml"

    def worlds_by_name(self) -> dict[str, dict[str, Any]]:
        """Of every world its description, and vehicle file and changes, or what is unusual in the second simulator."""
        return yaml.safe_load(self.worlds.read_text(encoding="utf-8"))

    def overrides(self) -> dict[str, dict[str, float]]:
        """Parameters of every set; the present one has none, so the defaults."""
        return {PRESENT: {}} | {one.name: dict(one.overrides) for one in load_study(self.sets).sets}


@dataclass(frozen=True)
class Folders:
    """Where flights are kept: what is judged, the saved flights from which it is made again, raw data for research."""

    judged: Path
    saved: Path
    raw: Path | None = None


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


def collect(
    files: StudyFiles, flights: int, folders: Folders, workers: int, names: Sequence[str] = ()
) -> dict[str, list[Path]]:
    """Folders of the scored flights of every world; flights that are there from the same sources are kept.

    Parameters
    ----------
    flights : number of flights per world
    folders : `judged` and `saved` take `<world>/<flight>`, `raw` takes `<world>/<flight>.npz`
    names : of the worlds, in the order in which they are flown; by default all
    """
    worlds = files.worlds_by_name()
    jobs = {name: [folders.judged / name / _flight_name(one) for one in range(flights)] for name in names or worlds}
    if workers == 1:
        for name in jobs:
            for number in range(flights):
                print(_fly_and_score(files, folders, name, number), flush=True)
        return jobs
    with ProcessPoolExecutor(workers) as pool:
        running = [
            pool.submit(_fly_and_score, files, folders, name, number) for name in jobs for number in range(flights)
        ]
        for job in running:
            print(job.result(), flush=True)
    return jobs


def _flight_name(number: int) -> str:
    return f"flight_{number:02}"


def _fly_and_score(files: StudyFiles, folders: Folders, world: str, number: int) -> str:
    target = folders.judged / world / _flight_name(number)
    sets = files.overrides()
    flown_from = _flown_from(files, world)
    key = _key(flown_from, source_digest("px4", "ekf2", "analyze"), sets)
    raw = folders.raw and folders.raw / world / f"{target.name}.npz"
    if _is_made_from(target, key) and (raw is None or raw.is_file()):
        return f"{target}: there"
    saved = saved_flight(files, folders.saved, world, number)
    stamp(target).unlink(missing_ok=True)
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    with tempfile.TemporaryDirectory() as scratch:
        analyzed = Path(scratch, "analyzed")
        settings = replay_settings(files.worlds_by_name()[world])
        replay_saved_flight(saved, sets, analyzed, settings)
        score_saved_flight(saved, analyzed, list(sets), present=PRESENT)
        estimate_delays(saved, analyzed, sets[PRESENT], replay=settings)
        for name in KEPT:
            shutil.copy(analyzed / name, target / name)
        if raw is not None:
            write_raw(raw, saved, analyzed, list(sets))
    stamp(target).write_text(key, encoding="utf-8")
    return f"{target}: scored"


def saved_flight(files: StudyFiles, folder: Path, world: str, number: int) -> Path:
    """A flight of a world, saved below `folder`; it is flown if it is not there from the same sources."""
    saved, flown_from = folder / world / _flight_name(number), _flown_from(files, world)
    if not _is_made_from(saved, flown_from):
        _fly(files, world, number, saved)
        stamp(saved).write_text(flown_from, encoding="utf-8")
    return saved


def _fly(files: StudyFiles, world: str, number: int, saved: Path) -> None:
    """Fly one flight of a world and save its log into `saved`."""
    stamp(saved).unlink(missing_ok=True)
    shutil.rmtree(saved, ignore_errors=True)
    saved.parent.mkdir(parents=True, exist_ok=True)
    described, seed = files.worlds_by_name()[world], FIRST_SEED + number
    with tempfile.TemporaryDirectory() as scratch:
        log = Path(scratch, f"{_flight_name(number)}.ulg")
        if "second" in described:
            write_ulog(log, fly(second_world(world, described["second"]), number, seed))
        else:
            simulate(load_mission(files.mission), vehicle_of(described), {}, seed, (), log)
        save_log(log, saved)


def replay_settings(described: Mapping[str, Any]) -> ReplaySettings:
    """How flights of a world are replayed: a whole log needs no repair, and starts cold."""
    if described.get("second", {}).get("default_profile", False):
        return replace(IN_USE, withholding=GNSS_GAPS)
    return ReplaySettings(withholding=GNSS_GAPS)


def _flown_from(files: StudyFiles, world: str) -> str:
    """Digest of what the saved flights of a world follow from."""
    described = files.worlds_by_name()[world]
    if "second" in described:
        sources = [HERE.parent / "thinned_logs.py", *sorted((HERE / "second_simulator").glob("*.py"))]
    else:
        sources = [files.mission, Path(described["vehicle"])]
    made_by = source_digest("px4", "save", *(() if "second" in described else ("design", "execute")))
    return _key(made_by, described, [file.read_text(encoding="utf-8") for file in sources])


def _key(*parts: object) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def stamp(folder: Path) -> Path:
    """The file that says what a folder was made from; beside it, for the folder is another's."""
    return folder.with_name(f"{folder.name}.made_from")


def _is_made_from(folder: Path, key: str) -> bool:
    file = stamp(folder)
    return folder.is_dir() and file.is_file() and file.read_text(encoding="utf-8") == key
