"""Which mission a flight flew, as its file holds it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fusetune.analyze.conformance.conformance import Conformance, best_of, conformance
from fusetune.analyze.conformance.flown_legs import FlownLeg
from fusetune.analyze.conformance.flown_track import FlownTrack
from fusetune.analyze.conformance.manoeuvres import manoeuvres
from fusetune.analyze.conformance.own_evidence import EVIDENCE_TOPICS
from fusetune.analyze.conformance.settings import DEFAULTS, ConformanceSettings
from fusetune.analyze.conformance.track_file import read_track
from fusetune.analyze.conformance.waypoint_passes import WaypointPass
from fusetune.design.missions.mission import Mission, load_mission
from fusetune.px4.flight import Flight
from fusetune.save.flight_folder import METADATA_FILE, load_flight, read_flight_document
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path

NO_PLACE = "its log holds no place on earth of a flight: neither a global position nor a GNSS fix, in the air"


def write_conformance(
    flight_folder: AnyPath,
    track_file: AnyPath,
    mission_files: Sequence[AnyPath],
    output: AnyPath,
    settings: ConformanceSettings = DEFAULTS,
) -> None:
    """Write `results/analyze/<flight>/conformance.json`.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    track_file : `results/analyze/<flight>/track.parquet`
    mission_files : of the missions that it is compared with

    Raises
    ------
    UserError
        A file is missing or damaged, or a mission is wrong.
    """
    track = read_track(track_file)
    readable = "topics" in read_flight_document(Path(flight_folder) / METADATA_FILE)
    flight = load_flight(flight_folder, EVIDENCE_TOPICS) if readable else Flight(Path(flight_folder).name)
    missions = [load_mission(file) for file in mission_files]
    with atomic_path(output) as temporary:
        write_document(temporary, rounded_figures(conformance_document(flight, track, missions, settings)))


def conformance_document(
    flight: Flight, track: FlownTrack | None, missions: Sequence[Mission], settings: ConformanceSettings = DEFAULTS
) -> dict[str, Any]:
    """What is told of a flight: times are µs since boot, lengths m, waypoints and legs are counted from 0.

    Returns
    -------
    `flown` names the mission that explains the flight best, None where it is none of them; `missions` holds how it
    compares with each, `manoeuvres` the class of every moment.
    """
    placed = track if track is not None and track.has_place else None
    compared = [] if placed is None else [conformance(flight, placed, one, settings) for one in missions]
    best = best_of(compared)
    moments = () if track is None else manoeuvres(track, settings)
    return {
        "flight": flight.name,
        "start_us": int(flight.start_timestamp),
        "track": None if track is None else track.source,
        "why_not_compared": NO_PLACE if placed is None else "",
        "flown": None if best is None else best.mission.name,
        "missions": [_mission_document(one) for one in compared],
        "manoeuvres": [{"kind": one.kind, "start_us": one.start, "stop_us": one.stop} for one in moments],
    }


def _mission_document(one: Conformance) -> dict[str, Any]:
    return {
        "mission": one.mission.name,
        "verdict": one.verdict,
        "why": one.why,
        "on_route_share": one.on_route_share,
        "home": {"lat": one.mission.home.lat, "lon": one.mission.home.lon, "alt": one.mission.home.alt},
        "waypoints": [_waypoint_document(each) for each in one.passes],
        "legs": [_leg_document(number, each) for number, each in enumerate(one.legs)],
        "evidence": asdict(one.evidence),
    }


def _waypoint_document(one: WaypointPass) -> dict[str, Any]:
    visit = one.visit
    return {
        "waypoint": one.planned.waypoint,
        "place_ned_m": one.planned.place.tolist(),
        "passed": one.is_passed,
        "in_order": one.in_order,
        "time_us": None if visit is None else visit.time,
        "miss_m": one.nearest_m if visit is None else visit.miss_m,
        "height_error_m": one.nearest_height_m if visit is None else visit.height_error_m,
        "allowed_m": one.allowed_m,
    }


def _leg_document(number: int, one: FlownLeg) -> dict[str, Any]:
    return {
        "leg": number,
        "kind": one.planned.kind,
        "waypoint": one.planned.waypoint,
        "start_ned_m": list(one.planned.start),
        "end_ned_m": list(one.planned.end),
        "planned_speed_m_s": one.planned.speed_m_s,
        "start_us": one.start,
        "stop_us": one.stop,
        "figures": None if one.figures is None else asdict(one.figures),
    }


def rounded_figures(value: Any) -> Any:
    """The same with figures to a tenth of a millimetre, and none where they are not finite."""
    if isinstance(value, Mapping):
        return {key: rounded_figures(one) if key not in ("lat", "lon") else one for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [rounded_figures(one) for one in value]
    if isinstance(value, float):
        return round(value, 4) + 0.0 if math.isfinite(value) else None
    return value
