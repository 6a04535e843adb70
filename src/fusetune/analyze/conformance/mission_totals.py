"""What all flights together made of each mission: who flew it, how often each waypoint was passed, how each leg."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import Any

from fusetune.analyze.conformance.conformance import VERDICTS
from fusetune.storage.documents import read_as, write_document
from fusetune.storage.files import AnyPath, atomic_path

Document = Mapping[str, Any]

MEANS = ("cross_track_mean", "cross_track_bias", "height_error_mean", "speed")
LARGEST = ("cross_track_95", "cross_track_max", "height_error_max")


def write_mission_totals(files: Sequence[AnyPath], output: AnyPath) -> None:
    """Write `results/analyze/missions.json`.

    Parameters
    ----------
    files : `results/analyze/<flight>/conformance.json` of all flights

    Raises
    ------
    UserError
        A file is missing or damaged.
    """
    found = [read_as(file, _known, "which mission a flight flew") for file in files]
    with atomic_path(output) as temporary:
        write_document(temporary, {"missions": mission_totals(found)})


def _known(document: Document) -> Document:
    return {name: document[name] for name in ("flight", "flown", "missions", "why_not_compared")}


def mission_totals(documents: Sequence[Document]) -> list[dict[str, Any]]:
    """Of each mission, in the order in which flights were compared with them.

    A flight counts for the mission that explains it best, and for no other. Figures of legs that are means are means
    over its flights; those that are largest values are the largest of them.
    """
    names = dict.fromkeys(one["mission"] for document in documents for one in document["missions"])
    found = []
    for name in names:
        compared = {
            document["flight"]: one for document in documents for one in document["missions"] if one["mission"] == name
        }
        flown = [compared[document["flight"]] for document in documents if document["flown"] == name]
        flights: dict[str, list[str]] = {verdict: [] for verdict in VERDICTS}
        for document in documents:
            if document["flight"] in compared:
                own = document["flown"] == name
                verdict = compared[document["flight"]]["verdict"] if own else VERDICTS[-1]
                flights[verdict].append(document["flight"])
        first = next(iter(compared.values()))
        found.append(
            {
                "mission": name,
                "flights": flights,
                "waypoints": [_waypoint(flown, number) for number in range(len(first["waypoints"]))],
                "legs": [_leg(flown, leg) for leg in first["legs"]],
            }
        )
    return found


def _waypoint(flown: Sequence[Document], number: int) -> dict[str, Any]:
    each = [one["waypoints"][number] for one in flown]
    passed = [one["miss_m"] for one in each if one["in_order"]]
    return {
        "waypoint": number,
        "flights": len(each),
        "in_order": len(passed),
        "out_of_order": sum(one["passed"] and not one["in_order"] for one in each),
        "missed": sum(not one["passed"] for one in each),
        "miss_mean_m": fmean(passed) if passed else None,
    }


def _leg(flown: Sequence[Document], leg: Document) -> dict[str, Any]:
    figures = [one["legs"][leg["leg"]]["figures"] for one in flown]
    known = [one for one in figures if one is not None]
    found: dict[str, Any] = {name: leg[name] for name in ("leg", "kind", "waypoint", "planned_speed_m_s")}
    found["flights"] = len(known)
    for name in MEANS:
        found[name] = fmean(one[name] for one in known) if known else None
    for name in LARGEST:
        found[name] = max(one[name] for one in known) if known else None
    return found
