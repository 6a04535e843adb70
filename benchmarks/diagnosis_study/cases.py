"""One flight of the study: what is injected, into which vehicle, on which mission, and the truth of it."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fusetune.design.missions.mission import Mission
from fusetune.execute.right_values import right_values
from fusetune.execute.sensors.faults import Fault, parse_faults
from fusetune.execute.vehicle import Vehicle

from .kinds import KINDS, Entry, Kind
from .missions import ALONG_THE_NOSE, MOTIONS, RECIPES, draw_mission
from .vehicles import draw_vehicle

HEALTHY, CALM, PAIRS = "healthy", "calm", "pairs"
"""Groups beside the kinds: without a fault; the guide's flight for drag in calm air, without one; with two."""
FLIGHT_ALTITUDE_M = 7.0
"""Above home, about: the air is as dense a few metres higher."""
DRAWS = 200
"""Of a pair until both are visible."""


@dataclass(frozen=True)
class Injection:
    """A fault and whether it can be seen."""

    kind: str
    magnitude: float
    is_visible: bool
    entries: tuple[Entry, ...]


@dataclass(frozen=True)
class Case:
    """A flight that can be flown again.

    Attributes
    ----------
    group : a kind, or one of the groups beside them; the folder of its flights
    number : within the group
    """

    group: str
    number: int
    seed: int
    mission: Mission
    vehicle: Vehicle
    injected: tuple[Injection, ...]

    @property
    def name(self) -> str:
        return f"{self.group}_{self.number:03}"

    @property
    def faults(self) -> tuple[Fault, ...]:
        """As the simulation takes them."""
        return parse_faults([entry for one in self.injected for entry in one.entries])

    def truth(self) -> dict[str, float]:
        """Values that estimates are compared with."""
        altitude = self.mission.home.alt + FLIGHT_ALTITUDE_M
        return right_values(self.vehicle, self.faults, self.seed, altitude)

    def document(self) -> dict[str, Any]:
        """What `fault.json` holds."""
        first = self.injected[0] if self.injected else None
        told = self.vehicle.parameters | {
            entry["parameter"]: entry["value"]
            for one in self.injected
            for entry in one.entries
            if entry["kind"] == "told_wrong"
        }
        return {
            "kind": first.kind if first and len(self.injected) == 1 else self.group,
            "magnitude": first.magnitude if first and len(self.injected) == 1 else None,
            "unit": KINDS[first.kind].magnitude if first and len(self.injected) == 1 else None,
            "visible": bool(self.injected) and all(one.is_visible for one in self.injected),
            "injected": [
                {"kind": one.kind, "magnitude": one.magnitude, "visible": one.is_visible, "faults": list(one.entries)}
                for one in self.injected
            ],
            "seed": self.seed,
            "wind_m_s": self.vehicle.environment.wind_speed_m_s,
            "told": told,
            "truth": self.truth(),
        }


def case_of(group: str, number: int) -> Case:
    """The case of a group; the same number always gives the same flight."""
    seed = zlib.crc32(f"{group} {number}".encode())
    rng = np.random.Generator(np.random.PCG64(seed))
    if group == HEALTHY:
        vehicle = draw_vehicle(rng)
        return Case(group, number, seed, draw_mission(rng, _flown_by(vehicle, tuple(MOTIONS))), vehicle, ())
    if group == CALM:
        vehicle = draw_vehicle(rng, (), wind=False)
        return Case(group, number, seed, draw_mission(rng, tuple(RECIPES)), vehicle, ())
    if group == PAIRS:
        return _pair(number, seed, rng)
    kind = KINDS[group]
    vehicle = draw_vehicle(rng, kind.sensors)
    motions = kind.recipe or kind.motions
    if not _flown_by(vehicle, motions):
        vehicle = replace(vehicle, airspeed=None)
    mission = draw_mission(rng, _flown_by(vehicle, motions))
    return Case(group, number, seed, mission, vehicle, (_inject(kind, rng, vehicle),))


def _flown_by(vehicle: Vehicle, motions: Sequence[str]) -> tuple[str, ...]:
    """Missions of these that a vehicle can fly: with a pitot tube it flies along its nose."""
    return tuple(one for one in motions if vehicle.airspeed is None or one in ALONG_THE_NOSE)


def _inject(kind: Kind, rng: np.random.Generator, vehicle: Vehicle) -> Injection:
    entries, magnitude = kind.draw(rng, vehicle)
    return Injection(kind.id, magnitude, magnitude >= kind.visible_from, tuple(entries))


def _pair(number: int, seed: int, rng: np.random.Generator) -> Case:
    """Two visible faults of different groups, on a motion that excites both."""
    names = list(KINDS)
    while True:
        first, second = (KINDS[names[int(one)]] for one in rng.choice(len(names), 2, replace=False))
        motions = [one for one in first.motions if one in second.motions]
        if first.group != second.group and motions:
            break
    vehicle = draw_vehicle(rng, tuple({*(first.sensors or ()), *(second.sensors or ())}))
    mission = draw_mission(rng, motions)
    injected = tuple(_visible(kind, rng, vehicle) for kind in (first, second))
    return Case(PAIRS, number, seed, mission, vehicle, injected)


def _visible(kind: Kind, rng: np.random.Generator, vehicle: Vehicle) -> Injection:
    """An injection that can be seen well."""
    for _ in range(DRAWS):
        injection = _inject(kind, rng, vehicle)
        if injection.is_visible:
            return injection
    raise AssertionError(f"{kind.id} is never visible")


def airborne_s(case: Case) -> float:
    """How long it is in the air."""
    from fusetune.execute.world.flight_plan import plan_flight

    events = plan_flight(case.mission, case.vehicle.limits).events
    return math.fsum((events.touchdown_s, -events.takeoff_s))
