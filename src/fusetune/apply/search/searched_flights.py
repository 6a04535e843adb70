"""Flights that are searched on: those of the vehicle whose replay is trusted, and what of the vehicle is searched."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fusetune.analyze.analyze_flight import AnalysisSettings, grade_saved_flight
from fusetune.analyze.trust.settings import reaches
from fusetune.apply.one_vehicle import decided_vehicle
from fusetune.apply.settings import DecisionSettings
from fusetune.design.around_present import not_exercised
from fusetune.design.search_settings import SearchSettings
from fusetune.errors import UserError
from fusetune.save.exercise import exercise_of
from fusetune.save.flight_folder import read_metadata
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.parquet import read_table


@dataclass(frozen=True)
class SearchedFlights:
    """On which flights is searched, and around what.

    Attributes
    ----------
    flights : in order of time; may be empty
    left_out : others that can be replayed, and why
    vehicle : EKF2 parameters that the vehicle flies, name → value
    parameters : names of those that are searched
    """

    flights: tuple[str, ...]
    left_out: Mapping[str, str]
    vehicle: Mapping[str, float]
    parameters: tuple[str, ...]


def searched_flights(
    folders: Mapping[str, AnyPath],
    flights_table: AnyPath,
    present_flight: str | None,
    search: SearchSettings,
    decision: DecisionSettings,
    analysis: AnalysisSettings,
    mapping: Callable[..., Iterable[Any]] = map,
) -> SearchedFlights:
    """Find the flights to search on.

    Parameters
    ----------
    folders : of the saved flights that can be replayed, by name, at the least
    flights_table : of all flights
    present_flight : by whose log the vehicle's parameters are known; None where no flight can be replayed
    mapping : `map`, or that of processes
    """
    if present_flight is None:
        return SearchedFlights((), {}, {}, ())
    rows = sorted(read_table(flights_table).to_pylist(), key=lambda row: (row["recorded"] or "", row["flight"]))
    replayable = [row["flight"] for row in rows if row["status"] == "replayable" and row["flight"] in folders]
    others = decided_vehicle(flights_table, replayable, present_flight).others
    left_out = {name: "it is of another vehicle" for name in replayable if name in others}
    own = [name for name in replayable if name not in others]
    grades = mapping(grade_saved_flight, [folders[name] for name in own], [analysis] * len(own))
    for name, grade in zip(own, grades, strict=True):
        if not reaches(grade.grade if grade.is_compared else None, decision.lowest_grade):
            left_out[name] = (
                f"its replay has trust grade {grade.grade}, and none below {decision.lowest_grade} is taken"
            )
    taken = tuple(name for name in own if name not in left_out)
    vehicle = read_metadata(folders[present_flight])["ekf2_parameters"]
    return SearchedFlights(taken, left_out, vehicle, _exercised(search, [folders[name] for name in taken]))


def _exercised(search: SearchSettings, folders: Iterable[AnyPath]) -> tuple[str, ...]:
    """Those that are asked for; by default those that the flights exercise."""
    if search.parameters:
        return search.parameters
    exercises = [exercise_of(folder) for folder in folders]
    return tuple(name for name in search.searched if not not_exercised(name, exercises))


def write_searched_flights(file: AnyPath, found: SearchedFlights) -> None:
    """Write what was found as JSON."""
    with atomic_path(file) as temporary:
        write_document(temporary, asdict(found), allow_nan=True)


def read_searched_flights(file: AnyPath) -> SearchedFlights:
    """Read what `write_searched_flights` wrote.

    Raises
    ------
    UserError
        There is none, or it cannot be read.
    """
    document = read_document(file)
    try:
        return SearchedFlights(
            tuple(document["flights"]), document["left_out"], document["vehicle"], tuple(document["parameters"])
        )
    except (TypeError, KeyError) as error:
        reason = f"does not say on which flights is searched ({error})"
        raise UserError(Path(file), reason, "Delete it and run the pipeline again") from error
