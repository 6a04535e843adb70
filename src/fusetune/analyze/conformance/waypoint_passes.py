"""When a flight passed which waypoint, and whether in its turn.

Of each waypoint all visits count at first: stretches of time in which the vehicle was near enough. A mission flown in
order is a chain of visits whose waypoints and times both ascend. The longest such chain is taken, and of several the
one that goes the least way round: so loops flown before, detours, hovers and a missing start change nothing. A waypoint
was passed in order if no other chain as long goes without it: of two that were swapped either could be left out, so
neither was. One that is not of the chain was passed out of order if it has a visit that is nobody else's, or else
missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.conformance.flown_track import LONGEST_GAP_US, FlownTrack
from fusetune.analyze.conformance.planned_passes import PlannedPass
from fusetune.analyze.conformance.settings import ConformanceSettings

Array = npt.NDArray[np.float64]


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
    track: FlownTrack, place: Array, planned: Sequence[PlannedPass], acceptance_m: float, settings: ConformanceSettings
) -> tuple[WaypointPass, ...]:
    """Decide every waypoint of a mission.

    Parameters
    ----------
    place : (N, 3) the track about the mission's home, NED, m
    acceptance_m : the vehicle's NAV_ACC_RAD
    """
    near = [_near(track, place, one, acceptance_m, settings) for one in planned]
    visits = [visit for number, one in enumerate(near) for visit in one.visits(number)]
    chain, sure = _chain(visits, place, track.time, [one.place for one in planned])
    taken = {visit.number: visit for visit in chain}
    found = []
    for number, (one, planned_one) in enumerate(zip(near, planned, strict=True)):
        visit = taken.get(number)
        if visit is None:
            own = [other for other in visits if other.number == number]
            visit = next((other for other in own if not _is_taken(other, chain, planned)), None)
        row = one.nearest_between(*_turn_of(number, chain, track.time))
        flat, height = float(one.flat[row]), float(one.height[row])
        found.append(WaypointPass(planned_one, visit, number in sure, flat, height, one.allowed))
    return tuple(found)


def _turn_of(number: int, chain: Sequence[Visit], time: npt.NDArray[np.int64]) -> tuple[int, int]:
    """When a waypoint would have had its turn: between those before and after it in the chain, µs."""
    before = [visit.time for visit in chain if visit.number < number]
    after = [visit.time for visit in chain if visit.number > number]
    return (max(before) if before else int(time[0])), (min(after) if after else int(time[-1]))


@dataclass(frozen=True)
class _Near:
    """Distances of a track (N,) to a waypoint, and where they are small enough."""

    time: npt.NDArray[np.int64]
    flat: Array
    height: Array
    inside: npt.NDArray[np.bool_]
    allowed: float

    def nearest_between(self, start: int, stop: int) -> int:
        """Row of the nearest sample from one time to another, µs."""
        away = np.hypot(self.flat, self.height)
        return int(np.argmin(np.where((self.time >= start) & (self.time <= stop), away, np.inf)))

    def visits(self, number: int) -> list[Visit]:
        gaps = np.r_[False, np.diff(self.time) > LONGEST_GAP_US]
        starts = np.flatnonzero(self.inside & (~np.r_[False, self.inside[:-1]] | gaps))
        found = []
        for start in starts.tolist():
            outside = np.flatnonzero(~self.inside[start:] | (gaps[start:] & (np.arange(self.time.size - start) > 0)))
            stop = start + int(outside[0]) if outside.size else self.time.size
            row = start + int(np.argmin(np.hypot(self.flat[start:stop], self.height[start:stop])))
            found.append(
                Visit(
                    number,
                    int(self.time[start]),
                    int(self.time[row]),
                    int(self.time[stop - 1]),
                    float(self.flat[row]),
                    float(self.height[row]),
                )
            )
        return found


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
    radius = planned.radius_m(sigma, acceptance_m, settings)
    inside = track.is_airborne & (flat <= radius) & (np.abs(height) <= planned.height_m(height_sigma, settings))
    return _Near(track.time, flat, height, inside, radius)


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
) -> tuple[list[Visit], set[int]]:
    """The longest chain of visits that goes the least way round, and the waypoints that every chain as long has."""
    if not visits:
        return [], set()
    ordered = sorted(visits, key=lambda one: (one.number, one.time))
    numbers, times = np.array([one.number for one in ordered]), np.array([one.time for one in ordered])
    way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1))][np.searchsorted(time, times)]
    spots = np.array([waypoints[one.number] for one in ordered])
    miss = np.array([one.miss_m for one in ordered])
    count, cost, before = np.ones(len(ordered), int), miss.copy(), np.full(len(ordered), -1)
    for node in range(len(ordered)):
        earlier = np.flatnonzero((numbers[:node] < numbers[node]) & (times[:node] < times[node]))
        if earlier.size:
            direct = np.linalg.norm(spots[earlier] - spots[node], axis=1)
            total = cost[earlier] + miss[node] + np.abs(way[node] - way[earlier] - direct)
            best = earlier[np.lexsort((total, -count[earlier]))[0]]
            before[node], count[node] = best, count[best] + 1
            cost[node] = float(total[earlier == best][0])
    longest = int(count.max())
    last = min(np.flatnonzero(count == longest).tolist(), key=lambda one: float(cost[one]))
    chain = []
    while last >= 0:
        chain.append(ordered[last])
        last = int(before[last])
    after = _counts_after(numbers, times)
    full = count + after - 1 == longest
    sure = {
        int(numbers[rows][0])
        for level in range(1, longest + 1)
        if np.unique(numbers[rows := full & (count == level)]).size == 1
    }
    return chain[::-1], sure


def _counts_after(numbers: npt.NDArray[np.int64], times: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """(N,) length of the longest chain that begins with each visit, itself counted."""
    found = np.ones(numbers.size, int)
    for node in range(numbers.size - 1, -1, -1):
        later = (numbers[node + 1 :] > numbers[node]) & (times[node + 1 :] > times[node])
        if later.any():
            found[node] = 1 + int(found[node + 1 :][later].max())
    return found
