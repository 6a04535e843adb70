"""Which flights are searched on: those of the vehicle whose replay is trusted. What is searched: what they exercise."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from fusetune.analyze.analyze_flight import AnalysisSettings, grade_saved_flight
from fusetune.analyze.trust.settings import reaches
from fusetune.apply.one_vehicle import decided_vehicle
from fusetune.apply.search.searched_flights import SearchedFlights
from fusetune.apply.settings import DecisionSettings
from fusetune.design.around_present import not_exercised
from fusetune.design.search_settings import SearchSettings
from fusetune.design.tunable_parameters import DELAY_LIMIT
from fusetune.ekf2.releases.behaviours import BASELINE
from fusetune.px4.parameters.ekf2_parameters import is_had_by
from fusetune.px4.releases import number_of_name
from fusetune.save.exercise import exercise_of
from fusetune.save.flight_folder import read_metadata
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table


def flights_to_search(
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
    vehicle = _present_of(read_metadata(folders[present_flight]))
    return SearchedFlights(taken, left_out, vehicle, _exercised(search, [folders[name] for name in taken]))


def _present_of(metadata: Mapping[str, Any]) -> dict[str, float]:
    """The vehicle's EKF2 parameters; where its release has no EKF2_DELAY_MAX, nothing bounds its delays."""
    replayed = metadata.get("release", {}).get("replayed") or BASELINE
    unbounded = not is_had_by(DELAY_LIMIT, number_of_name(replayed))
    return {**metadata["ekf2_parameters"], **({DELAY_LIMIT: math.inf} if unbounded else {})}


def _exercised(search: SearchSettings, folders: Iterable[AnyPath]) -> tuple[str, ...]:
    """Those that are asked for; by default those that the flights exercise."""
    if search.parameters:
        return search.parameters
    exercises = [exercise_of(folder) for folder in folders]
    return tuple(name for name in search.searched if not not_exercised(name, exercises))
