"""What a log itself tells of a mission: where the vehicle meant to go, what it counted as reached, in which mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusetune.analyze.conformance.flown_track import FlownTrack
from fusetune.design.missions.mission import Mission, distance_m
from fusetune.px4.flight import Flight

EVIDENCE_TOPICS = ("mission_result", "position_setpoint_triplet", "vehicle_command", "vehicle_status")

AUTO_MISSION = 3
"""`vehicle_status.nav_state` of a vehicle that flies a mission."""
MISSION_START = 300
"""MAV_CMD_MISSION_START."""
_SAME_PLACE_M = 1.0
"""Setpoints are the waypoints themselves, but for rounding to 1e-7 degrees and to single precision."""


@dataclass(frozen=True)
class OwnEvidence:
    """What the log tells.

    Attributes
    ----------
    mission_mode_share : of the time in the air in mission mode; None where the log does not say
    reached : items of its mission that the vehicle counted as reached, the most at once; None likewise
    is_finished : whether it counted a mission as finished; None likewise
    was_started : whether a command to start a mission was given
    asked : waypoints of the mission compared, by index, that it had as its place to go to; None likewise
    """

    mission_mode_share: float | None
    reached: int | None
    is_finished: bool | None
    was_started: bool
    asked: tuple[int, ...] | None


def own_evidence(flight: Flight, track: FlownTrack, mission: Mission) -> OwnEvidence:
    """Look for it.

    Parameters
    ----------
    flight : canonical, with `EVIDENCE_TOPICS`
    """
    result, command = flight.topic("mission_result"), flight.topic("vehicle_command")
    reached = finished = None
    if result is not None and "seq_reached" in result and result["timestamp"].size:
        reached = int(np.max(result["seq_reached"].astype(np.int64))) + 1
        finished = bool(np.any(result["finished"])) if "finished" in result else None
    started = command is not None and "command" in command and bool(np.any(command["command"] == MISSION_START))
    return OwnEvidence(_mission_share(flight, track), reached, finished, started, _asked(flight, mission))


def _mission_share(flight: Flight, track: FlownTrack) -> float | None:
    status = flight.topic("vehicle_status")
    if status is None or "nav_state" not in status or not status["timestamp"].size:
        return None
    row = np.searchsorted(status["timestamp"].astype(np.int64), track.time[track.is_airborne], side="right") - 1
    known = row[row >= 0]
    return float(np.mean(status["nav_state"][known] == AUTO_MISSION)) if known.size else None


def _asked(flight: Flight, mission: Mission) -> tuple[int, ...] | None:
    """Waypoints that were the current setpoint."""
    table = flight.topic("position_setpoint_triplet")
    if table is None or not {"current.lat", "current.lon", "current.valid"} <= set(table):
        return None
    valid = table["current.valid"].astype(bool) & np.isfinite(table["current.lat"]) & np.isfinite(table["current.lon"])
    places = {*zip(table["current.lat"][valid].tolist(), table["current.lon"][valid].tolist(), strict=True)}
    return tuple(
        index
        for index, waypoint in enumerate(mission.waypoints)
        if any(distance_m(waypoint.lat, waypoint.lon, lat, lon) <= _SAME_PLACE_M for lat, lon in places)
    )
