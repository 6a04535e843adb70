"""When a flight passed which waypoint, and whether in its turn.

Of each waypoint all visits count at first: stretches of time in which the vehicle was near enough, and where it was to
hold for as long. A mission flown in order is a chain of visits whose waypoints and times both ascend. The longest such
chain is taken, and of several the one that goes the least way round: so loops flown before, detours, hovers and a
missing start change nothing.

A waypoint that is not of the chain was missed, unless it has a stray visit: one that neither a waypoint of the chain at
the same place explains, nor the way from one pass to the next, which leads by it. Then it was passed out of order; and
so was one of the chain that could be left out for it: of two that were swapped either could, so neither was passed in
order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from fusetune.analyze.conformance.flown_track import LONGEST_GAP_US, FlownTrack
from fusetune.analyze.conformance.planned_passes import PlannedPass
from fusetune.analyze.conformance.settings import ConformanceSettings
from fusetune.analyze.flight.intervals import stretches
from fusetune.design.missions.route import Place

Array = npt.NDArray[np.float64]


_HELD_SHARE = 0.8
"""Of the time that a vehicle is to hold, which it begins to count a little after it came near."""


@dataclass(frozen=True)
class Visit:
    """A stretch of time near a waypoint; µs since boot, m.

    Attributes
    ----------
    number : of the waypoint among those planned
    miss_m, height_error_m : horizontal distance at `time`, where the flight came nearest, and height less that planned
    """

    number: int
    enter: int
    time: int
    leave: int
    miss_m: float
    height_error_m: float


@dataclass(frozen=True)
class WaypointPass:
    """What a flight did about a waypoint.

    Attributes
    ----------
    planned : how it was to be passed
    visit : when it was; None where it was not
    in_order : whether in its turn
    nearest_m, nearest_height_m : how near it came, in place and height, between the passes before and after it
    allowed_m : horizontal distance within which it would have been passed there
    """

    planned: PlannedPass
    visit: Visit | None
    in_order: bool
    nearest_m: float
    nearest_height_m: float
    allowed_m: float

    @property
    def is_passed(self) -> bool:
        return self.visit is not None


def waypoint_passes(
    track: FlownTrack,
    place: Array,
    planned: Sequence[PlannedPass],
    ends: tuple[Place, Place],
    acceptance_m: float,
    settings: ConformanceSettings,
) -> tuple[WaypointPass, ...]:
    """Decide every waypoint of a mission.

    Parameters
    ----------
    place : (N, 3) the track about the mission's home, NED, m
    ends : where the climb from the ground ends, and where the descent to it begins, NED, m
    acceptance_m : the vehicle's NAV_ACC_RAD
    """
    near = [_near(track, place, one, acceptance_m, settings) for one in planned]
    visits = [visit for number, one in enumerate(near) for visit in one.visits(number, planned[number].hold_s)]
    chain = _chain(visits, place, track.time, [one.place for one in planned])
    taken = {visit.number: visit for visit in chain}
    strays = [] if not chain else _strays(near, chain, planned, ends)
    sure = _in_every_chain([*chain, *strays])
    found = []
    for number, (one, planned_one) in enumerate(zip(near, planned, strict=True)):
        visit = taken.get(number) or next((stray for stray in strays if stray.number == number), None)
        row = one.nearest_between(*_turn_of(number, chain, track.time))
        flat, height = float(one.flat[row]), float(one.height[row])
        found.append(WaypointPass(planned_one, visit, number in sure, flat, height, one.allowed))
    return tuple(found)


def _strays(
    near: Sequence[_Near], chain: Sequence[Visit], planned: Sequence[PlannedPass], ends: tuple[Place, Place]
) -> list[Visit]:
    """Visits of waypoints that are not of the chain, out of its order or of each other's, that nothing explains.

    In another order the corners are others, so these may be cut as much as any.
    """
    chained = {visit.number for visit in chain}
    found = [
        visit
        for number, one in enumerate(near)
        if number not in chained
        for visit in one.visits(number, planned[number].hold_s, any_corner=True)
        if not _is_taken(visit, chain, planned) and not _is_by_the_way(visit, one.allowed_anyhow, chain, planned, ends)
    ]
    return [one for one in found if any(_are_swapped(one, other) for other in (*chain, *found))]


def _are_swapped(one: Visit, other: Visit) -> bool:
    return (one.number < other.number) != (one.time < other.time) and one.number != other.number


def _is_by_the_way(
    visit: Visit,
    allowed_m: float,
    chain: Sequence[Visit],
    planned: Sequence[PlannedPass],
    ends: tuple[Place, Place],
) -> bool:
    """Whether a waypoint lies beside the way from the pass before the visit to the one after it."""
    before = max((one for one in chain if one.time <= visit.time), key=lambda one: one.time, default=None)
    after = min((one for one in chain if one.time > visit.time), key=lambda one: one.time, default=None)
    start = np.array(ends[0]) if before is None else planned[before.number].place
    stop = np.array(ends[1]) if after is None else planned[after.number].place
    way, target = stop - start, planned[visit.number].place - start
    length = float(way @ way)
    along = min(max(float(target @ way) / length, 0.0), 1.0) if length > 0.0 else 0.0
    return float(np.linalg.norm(target - along * way)) <= allowed_m


def _turn_of(number: int, chain: Sequence[Visit], time: npt.NDArray[np.int64]) -> tuple[int, int]:
    """When a waypoint would have had its turn: between those before and after it in the chain, µs."""
    before = [visit.time for visit in chain if visit.number < number]
    after = [visit.time for visit in chain if visit.number > number]
    return (max(before) if before else int(time[0])), (min(after) if after else int(time[-1]))


@dataclass(frozen=True)
class _Near:
    """Distances of a track (N,) to a waypoint, and where they are small enough, as planned or whatever the corner."""

    time: npt.NDArray[np.int64]
    flat: Array
    height: Array
    inside: npt.NDArray[np.bool_]
    inside_anyhow: npt.NDArray[np.bool_]
    allowed: float
    allowed_anyhow: float

    def nearest_between(self, start: int, stop: int) -> int:
        """Row of the nearest sample from one time to another, µs."""
        away = np.hypot(self.flat, self.height)
        return int(np.argmin(np.where((self.time >= start) & (self.time <= stop), away, np.inf)))

    def visits(self, number: int, hold_s: float, *, any_corner: bool = False) -> list[Visit]:
        inside = self.inside_anyhow if any_corner else self.inside
        cuts = np.flatnonzero(np.diff(self.time) > LONGEST_GAP_US) + 1
        found = []
        for start, stop in stretches(inside):
            parts = [start, *cuts[(cuts > start) & (cuts < stop)].tolist(), stop]
            found += [self._visit(number, first, last) for first, last in pairwise(parts)]
        return [one for one in found if (one.leave - one.enter) * 1e-6 >= _HELD_SHARE * hold_s]

    def _visit(self, number: int, start: int, stop: int) -> Visit:
        row = start + int(np.argmin(np.hypot(self.flat[start:stop], self.height[start:stop])))
        enter, time, leave = (int(self.time[one]) for one in (start, row, stop - 1))
        return Visit(number, enter, time, leave, float(self.flat[row]), float(self.height[row]))


def _near(
    track: FlownTrack, place: Array, planned: PlannedPass, acceptance_m: float, settings: ConformanceSettings
) -> _Near:
    away = place - planned.place
    flat, height = np.hypot(away[:, 0], away[:, 1]), -away[:, 2]
    row = int(np.argmin(np.where(track.is_airborne, np.hypot(flat, height), np.inf)))
    sigma, height_sigma = (
        max(settings.least_unknown_m, float(np.nan_to_num(one[row])))
        for one in (track.horizontal_sigma, track.vertical_sigma)
    )
    radius, anyhow = (
        planned.radius_m(sigma, acceptance_m, settings, any_corner=any_corner) for any_corner in (False, True)
    )
    level = track.is_airborne & (np.abs(height) <= planned.height_m(height_sigma, settings))
    return _Near(track.time, flat, height, level & (flat <= radius), level & (flat <= anyhow), radius, anyhow)


def _is_taken(visit: Visit, chain: Sequence[Visit], planned: Sequence[PlannedPass]) -> bool:
    """Whether a visit is that of a waypoint of the chain which lies at the same place."""
    place = planned[visit.number].place
    return any(
        one.enter <= visit.leave
        and visit.enter <= one.leave
        and float(np.linalg.norm(planned[one.number].place - place)) < planned[visit.number].farthest_m
        for one in chain
    )


def _chain(
    visits: Sequence[Visit], place: Array, time: npt.NDArray[np.int64], waypoints: Sequence[Array]
) -> list[Visit]:
    """The longest chain of visits that goes the least way round."""
    if not visits:
        return []
    ordered = sorted(visits, key=lambda one: (one.number, one.time))
    numbers, times = np.array([one.number for one in ordered]), np.array([one.time for one in ordered])
    way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1))][np.searchsorted(time, times)]
    spots = np.array([waypoints[one.number] for one in ordered])
    miss = np.array([one.miss_m for one in ordered])
    count, cost, before = np.ones(len(ordered), int), miss.copy(), np.full(len(ordered), -1)
    for node in range(len(ordered)):
        # who leaves out what lies between two waypoints at one place visits both at once
        at_once = (times[:node] == times[node]) & (numbers[:node] == numbers[node] - 2)
        earlier = np.flatnonzero((numbers[:node] < numbers[node]) & ((times[:node] < times[node]) | at_once))
        if earlier.size:
            direct = np.linalg.norm(spots[earlier] - spots[node], axis=1)
            total = cost[earlier] + miss[node] + np.abs(way[node] - way[earlier] - direct)
            best = int(np.lexsort((total, -count[earlier]))[0])
            before[node], count[node] = earlier[best], count[earlier[best]] + 1
            cost[node] = total[best]
    last = int(np.lexsort((cost, -count))[0])
    chain = []
    while last >= 0:
        chain.append(ordered[last])
        last = int(before[last])
    return chain[::-1]


def _in_every_chain(visits: Sequence[Visit]) -> set[int]:
    """Waypoints that every chain as long as the longest has."""
    ordered = sorted(visits, key=lambda one: (one.number, one.time))
    numbers, times = np.array([one.number for one in ordered]), np.array([one.time for one in ordered])
    before, after = (np.ones(len(ordered), int) for _ in range(2))
    for node in range(len(ordered)):
        earlier = (numbers[:node] < numbers[node]) & (times[:node] <= times[node])
        before[node] = 1 + int(before[:node][earlier].max(initial=0))
    for node in reversed(range(len(ordered))):
        later = (numbers[node + 1 :] > numbers[node]) & (times[node + 1 :] >= times[node])
        after[node] = 1 + int(after[node + 1 :][later].max(initial=0))
    longest = int(before.max(initial=0))
    levels = (
        np.unique(numbers[(before == level) & (before + after - 1 == longest)]) for level in range(1, longest + 1)
    )
    return {int(level[0]) for level in levels if level.size == 1}
