"""What the user gives: sets, mission and logs, as the configuration names them, checked before anything runs."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fusetune.configuration import Configuration
from fusetune.design.missions.mission import Mission, load_mission
from fusetune.design.study import Study, load_study
from fusetune.errors import UserError
from fusetune.execute.sensors.faults import parse_faults
from fusetune.execute.vehicle import load_vehicle
from fusetune.save.discovery import Discovery, discover_logs
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class Inputs:
    """What the configuration asks for, read from where it says."""

    study: Study
    study_file: str
    """The configuration's own, or that of the demonstration."""
    mission: Mission
    found: Discovery
    """Logs in the folder of flights and in folders below it, and what looks like one and cannot be flown."""
    mission_files: tuple[str, ...]
    """Missions that flights are compared with, the configuration's own first."""
    simulated: dict[str, str]
    """Flights of the demonstration, name → set flown: every set of the study in turn, as in the paper's experiment."""

    @property
    def is_demonstration(self) -> bool:
        """Whether the flights are simulated.

        A folder with nothing but entries that cannot be flown is not empty: its user waits for a word on those.
        """
        return not (self.found.logs or self.found.refused)

    @property
    def flights(self) -> list[str]:
        """Names of the flights that the pipeline works on."""
        return list(self.simulated) if self.is_demonstration else [log.flight for log in self.found.logs]


def read_inputs(settings: Configuration, file: AnyPath) -> Inputs:
    """Read study and mission, and look for logs.

    Parameters
    ----------
    file
        The configuration's, named in messages.

    Raises
    ------
    UserError
        A file or the folder of flights cannot be used, or the configuration names a flight that does not exist.
    """
    found = _discovered(settings.flights_dir, file)
    study, study_file = load_study(settings.study, settings.release), settings.study
    if study.needs_flights and not (found.logs or found.refused):
        study, study_file = load_study(settings.demonstration.study, settings.release), settings.demonstration.study
        if study.needs_flights:
            reason = f"demonstration.study is {study_file!r}, whose sets follow from flights"
            raise UserError(file, reason, "Name a study with sets of its own")
    if study.search is not None and settings.decision.only_classes:
        reason = f"decision.only_classes is set, and {study_file!r} is a search, which compares whole flights"
        raise UserError(file, reason, "Leave one of them out")
    mission = load_mission(settings.mission)
    if settings.mission_vehicle is not None:
        load_vehicle(settings.mission_vehicle)
    simulated = dict(_simulated_flights(study, settings.demonstration.flights_per_set))
    for flight in settings.demonstration.faults:
        # with logs, a study whose sets follow from them names no flights of the demonstration
        if flight not in simulated and not study.needs_flights:
            reason = f"demonstration.faults names the flight {flight!r}; expected one of {', '.join(simulated)}"
            raise UserError(file, reason, "Mend the name")
    inputs = Inputs(study, study_file, mission, found, _mission_files(settings, mission, file), simulated)
    if settings.present_flight not in (None, *inputs.flights):
        reason = f"present_flight is {settings.present_flight!r}, which is no flight in {settings.flights_dir!r}"
        raise UserError(file, reason, "Name one of its logs without .ulg, or leave it empty for the newest")
    return inputs


def check_demonstration(settings: Configuration, file: AnyPath) -> None:
    """Check what jobs would read of the demonstration, so that no job has to fail of it.

    Raises
    ------
    UserError
        The vehicle's file or a fault is broken.
    """
    load_vehicle(settings.demonstration.vehicle)
    for flight, faults in settings.demonstration.faults.items():
        parse_faults(faults, f"{file}: demonstration.faults.{flight}")


def _simulated_flights(study: Study, flights_per_set: int) -> Iterator[tuple[str, str]]:
    turns = [pset.name for _ in range(flights_per_set) for pset in study.sets]
    digits = len(str(len(turns)))
    for number, name in enumerate(turns, 1):
        yield f"flight_{number:0{digits}}_{name}", name


def _mission_files(settings: Configuration, mission: Mission, file: AnyPath) -> tuple[str, ...]:
    """Files of the missions, each read once so that no job has to fail of it."""
    if settings.missions_dir is None:
        return (settings.mission,)
    folder = Path(settings.missions_dir)
    try:
        entries = sorted(
            one for one in os.listdir(folder) if one.endswith((".yaml", ".plan")) and not one.startswith(".")
        )
    except OSError as error:
        reason = f"missions_dir is {settings.missions_dir!r}, which is no folder that can be read ({error.strerror})"
        raise UserError(file, reason, "Make it, mend its permissions, or name another") from error
    others = [folder / one for one in entries if (folder / one).resolve() != Path(settings.mission).resolve()]
    names = {mission.name: settings.mission}
    for other in others:
        name = load_mission(other).name
        if name in names:
            raise UserError(
                other, f"has the name {name!r}, as {names[name]} has", "Give each mission a name of its own"
            )
        names[name] = str(other)
    return tuple(names.values())


def _discovered(folder: str, file: AnyPath) -> Discovery:
    try:
        return discover_logs(folder)
    except OSError as error:
        reason = f"flights_dir is {folder!r}, which is no folder that can be read ({error.strerror})"
        raise UserError(file, reason, "Make it, mend its permissions, or name another") from error
