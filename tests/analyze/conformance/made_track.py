"""Tracks of the paths that the simulated vehicle means to fly, without its flight: known to the millimetre."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from benchmarks.conformance import HOME, VEHICLE

from fusetune.analyze.conformance.conformance import Conformance, conformance
from fusetune.analyze.conformance.flown_track import STEP_US, FlownTrack
from fusetune.design.missions.mission import Mission
from fusetune.execute.vehicle import load_vehicle
from fusetune.execute.world.flight_plan import plan_flight
from fusetune.px4.flight import Flight
from fusetune.px4.local_map import LocalMap

Array = npt.NDArray[np.float64]

LIMITS = load_vehicle(VEHICLE).limits


def track_of(place: Array, airborne: Sequence[tuple[int, int]] | None = None) -> FlownTrack:
    """A track through places (N, 3) north, east, down of `HOME`, m, one every `STEP_US`, in the air throughout."""
    time = STEP_US * np.arange(1, len(place) + 1)
    local = LocalMap(HOME.lat, HOME.lon)
    lat, lon = np.array([local.to_global(*one) for one in place[:, :2].tolist()]).T
    unknown = np.full(len(place), np.nan)
    velocity = np.gradient(place, STEP_US * 1e-6, axis=0)
    flown = tuple(airborne) if airborne is not None else ((int(time[0]), int(time[-1])),)
    return FlownTrack("estimate", time, lat, lon, -place[:, 2], velocity, unknown, unknown, unknown, True, flown)


def planned_places(mission: Mission) -> Array:
    """(N, 3) where the simulated vehicle means to be, from take-off to touch-down."""
    plan = plan_flight(mission, LIMITS)
    return plan.path.evaluate(np.arange(plan.events.takeoff_s, plan.events.touchdown_s, STEP_US * 1e-6))


def flown_in_order(mission: Mission, order: Sequence[int]) -> Array:
    """The same of a mission whose waypoints were flown in another order, or in part."""
    return planned_places(replace(mission, waypoints=tuple(mission.waypoints[index] for index in order)))


def compared(place: Array, mission: Mission) -> Conformance:
    """Places compared with a mission, by a log that tells nothing else."""
    return conformance(Flight("made"), track_of(place), mission)
