"""Whether a flight flew a mission: its waypoints, its legs, what the log itself tells, and the verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from fusetune.analyze.conformance.flown_legs import FlownLeg, flown_legs
from fusetune.analyze.conformance.flown_track import TRACK_TOPICS, FlownTrack
from fusetune.analyze.conformance.own_evidence import EVIDENCE_TOPICS, OwnEvidence, own_evidence
from fusetune.analyze.conformance.planned_passes import planned_passes, sound_value
from fusetune.analyze.conformance.settings import DEFAULTS, ConformanceSettings
from fusetune.analyze.conformance.waypoint_passes import WaypointPass, waypoint_passes
from fusetune.design.missions.mission import Mission
from fusetune.design.missions.route import RouteLeg, route_of
from fusetune.px4.flight import Flight

Array = npt.NDArray[np.float64]

CONFORMANCE_TOPICS = tuple(dict.fromkeys((*TRACK_TOPICS, *EVIDENCE_TOPICS)))
"""What is read of a saved flight."""

Verdict = Literal["flew", "flew in part", "flew otherwise", "not this mission"]
VERDICTS: tuple[Verdict, ...] = ("flew", "flew in part", "flew otherwise", "not this mission")
"""Those that fit best first."""

_FEWEST_PASSED = 2
"""A single waypoint is soon passed by a flight that means something else."""
_PART_PASSED = 0.5
_PART_ON_ROUTE = 0.5
_FAR_M = 1000.0


@dataclass(frozen=True)
class Conformance:
    """How a flight compares with a mission.

    Attributes
    ----------
    mission : what it is compared with
    passes : of each waypoint
    legs : of its route
    on_route_share : of the way that was flown, what the legs that were flown ask for, 0 … 1
    evidence : what the log tells itself
    verdict, why : in words
    """

    mission: Mission
    passes: tuple[WaypointPass, ...]
    legs: tuple[FlownLeg, ...]
    on_route_share: float
    evidence: OwnEvidence
    verdict: Verdict
    why: str

    @property
    def fit(self) -> tuple[int, float, float]:
        """The less, the better does this mission explain the flight."""
        passed = sum(one.is_passed for one in self.passes) / len(self.passes)
        return VERDICTS.index(self.verdict), -round(self.on_route_share, 2), -passed


def conformance(
    flight: Flight, track: FlownTrack, mission: Mission, settings: ConformanceSettings = DEFAULTS
) -> Conformance:
    """Compare a flight with a mission.

    Parameters
    ----------
    flight : canonical, with `CONFORMANCE_TOPICS`
    track : of this flight
    """
    route = route_of(mission)
    place = track.about(mission.home.lat, mission.home.lon, mission.home.alt)
    parameters = {name: float(value) for name, value in flight.parameters.initial.items()}
    acceptance = sound_value(parameters, "NAV_ACC_RAD", settings.crossing_m)
    planned = planned_passes(route, parameters, settings)
    passes = waypoint_passes(track, place, planned, (route[0].end, route[-1].start), acceptance, settings)
    legs = flown_legs(track, place, route, passes, settings)
    share = _on_route_share(track, place, legs)
    evidence = own_evidence(flight, track, mission)
    verdict, why = _judged(track, place, route, passes, share, evidence)
    return Conformance(mission, passes, legs, share, evidence, verdict, why)


def best_of(compared: Sequence[Conformance]) -> Conformance | None:
    """The mission that a flight flew, whole, in part or otherwise; None where it is none of them."""
    best = min(compared, key=lambda one: one.fit, default=None)
    return best if best is not None and best.verdict != "not this mission" else None


def _on_route_share(track: FlownTrack, place: Array, legs: Sequence[FlownLeg]) -> float:
    """Of the way that was flown in the air the share that the legs flown ask for; what is more is detour."""
    step = np.r_[0.0, np.linalg.norm(np.diff(place, axis=0), axis=1)] * track.is_airborne
    total = float(step.sum())
    on = 0.0
    for one in legs:
        if one.start is not None and one.stop is not None:
            way = float(step[(track.time >= one.start) & (track.time < one.stop)].sum())
            on += min(way, one.planned.length_m)
    return min(on / total, 1.0) if total > 0.0 else 0.0


def _judged(
    track: FlownTrack,
    place: Array,
    route: Sequence[RouteLeg],
    passes: Sequence[WaypointPass],
    share: float,
    evidence: OwnEvidence,
) -> tuple[Verdict, str]:
    total = len(passes)
    passed = [one for one in passes if one.is_passed]
    missed = [one.planned.waypoint for one in passes if not one.is_passed]
    astray = [one.planned.waypoint for one in passed if not one.in_order]
    told = _asked_words(evidence, total)
    if len(passed) == total and not astray:
        return "flew", f"it passed all {total} waypoints in order{_beside(share)}"
    is_part = len(passed) >= _FEWEST_PASSED and (len(passed) >= _PART_PASSED * total or share >= _PART_ON_ROUTE)
    if is_part and astray:
        missing = f"; it missed {_listed(missed)}" if missed else ""
        return "flew otherwise", f"it passed {_listed(astray)} out of order{missing}{told}"
    if is_part:
        return "flew in part", f"it missed {_listed(missed)} of {total} waypoints{_nearest(passes)}{told}"
    if evidence.asked:
        return "flew in part", f"it passed {len(passed)} of {total} waypoints{told}"
    away = float(np.min(np.hypot(*(place[track.is_airborne] - np.array(route[0].end))[:, :2].T), initial=np.inf))
    if away > _FAR_M and not passed:
        return "not this mission", f"it came no nearer to its home than {away / 1000.0:.1f} km"
    return "not this mission", f"it passed {len(passed)} of its {total} waypoints"


def _listed(waypoints: Sequence[int]) -> str:
    """Waypoints as people count them."""
    names = [str(one + 1) for one in waypoints]
    word = "waypoint" if len(names) == 1 else "waypoints"
    return f"{word} {', '.join(names[:-1])}{' and ' if len(names) > 1 else ''}{names[-1]}"


def _beside(share: float) -> str:
    return "" if share >= _PART_ON_ROUTE else f", and flew {100.0 * (1.0 - share):.0f} % of its way elsewhere"


def _nearest(passes: Sequence[WaypointPass]) -> str:
    """How near it came to those that it missed."""
    missed = [one for one in passes if not one.is_passed]
    if len(missed) != 1:
        return ""
    one = missed[0]
    return f" (it came within {one.nearest_m:.1f} m beside and {abs(one.nearest_height_m):.1f} m in height)"


def _asked_words(evidence: OwnEvidence, total: int) -> str:
    if evidence.asked is None:
        return ""
    return f"; {len(evidence.asked)} of {total} were places that the vehicle meant to go to"
