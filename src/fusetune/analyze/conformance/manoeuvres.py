"""What each moment of a flight is: on the ground, take-off, hover, straight, turn, climb, descent or landing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.conformance.flown_track import STEP_US, FlownTrack, parts_of
from fusetune.analyze.conformance.settings import DEFAULTS, ConformanceSettings
from fusetune.analyze.flight.intervals import stretches
from fusetune.analyze.flight.manoeuvre_classes import (
    CLIMB,
    DESCENT,
    GROUND,
    HOVER,
    LANDING,
    STRAIGHT,
    TAKEOFF,
    TURN,
)

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

_AVERAGED_STEPS = 1_000_000 // STEP_US + 1
"""About a second: longer than gusts turn a vehicle, shorter than a turn."""
_NEAR_GROUND_US = 5_000_000
"""A climb that begins so soon after the vehicle left the ground is its take-off, a descent that ends so shortly before
it has landed its landing: PX4's land detector takes three times LNDMC_TRIG_TIME, 1 s, from ground contact to landed,
and the vehicle spools up over MPC_TKO_RAMP_T, 3 s."""


@dataclass(frozen=True)
class Manoeuvre:
    """A stretch of a flight that is of one class; times µs since boot."""

    kind: str
    start: int
    stop: int

    @property
    def seconds(self) -> float:
        return (self.stop - self.start) * 1e-6


def manoeuvres(track: FlownTrack, settings: ConformanceSettings = DEFAULTS) -> tuple[Manoeuvre, ...]:
    """The whole of a track in stretches of one class each, in order of time; where the log has gaps there is none."""
    found: list[Manoeuvre] = []
    for part in parts_of(track.time):
        time = track.time[part]
        kinds = _kinds(time, track.velocity[part], track.heading[part], track.is_airborne[part], settings)
        found += _with_ends(_merged(list(_runs(time, kinds)), settings.shortest_s), settings)
    return tuple(found)


def _kinds(
    time: npt.NDArray[np.int64], velocity: Array, heading: Array, airborne: Flags, settings: ConformanceSettings
) -> list[str]:
    """Class of each moment (N,), by itself but for where a manoeuvre began."""
    smooth = np.column_stack([_averaged(axis) for axis in velocity.T])
    speed, up = np.hypot(smooth[:, 0], smooth[:, 1]), -smooth[:, 2]
    angle = np.degrees(np.arctan2(np.abs(up), speed))
    begins, ends = settings.climb_m_s, settings.climb_angle_deg
    vertical = _held((np.abs(up) > begins[0]) & (angle > ends[0]), (np.abs(up) > begins[1]) & (angle > ends[1]))
    hovers = _held(speed < settings.hover_m_s[0], speed < settings.hover_m_s[1])
    turns = _turns(time, smooth, speed, heading, settings)
    kinds = np.select(
        [~airborne, vertical & (up > 0.0), vertical, turns, hovers],
        [GROUND, CLIMB, DESCENT, TURN, HOVER],
        default=STRAIGHT,
    )
    return [str(one) for one in kinds]


def _turns(
    time: npt.NDArray[np.int64], velocity: Array, speed: Array, heading: Array, settings: ConformanceSettings
) -> Flags:
    """Where the course turns, or the heading; (N,)."""
    seconds = (time - time[0]) * 1e-6
    if time.size < _AVERAGED_STEPS:
        return np.zeros(time.size, bool)
    acceleration = np.gradient(velocity[:, :2], seconds, axis=0)
    across = velocity[:, 0] * acceleration[:, 1] - velocity[:, 1] * acceleration[:, 0]
    # slower than a hover ends, a vehicle has no course
    has_course = speed > settings.hover_m_s[1]
    course_rate = np.degrees(np.where(has_course, across / np.maximum(speed, 0.1) ** 2, 0.0))
    heading_rate = np.degrees(_averaged(np.gradient(heading, seconds)))
    turning = np.zeros(time.size, bool)
    for rate in (course_rate, np.nan_to_num(heading_rate)):
        begin, end = settings.turn_deg_s
        for start, stop in stretches(_held(np.abs(rate) > begin, np.abs(rate) > end)):
            if abs(float(rate[start:stop].sum())) * STEP_US * 1e-6 >= settings.turn_least_deg:
                turning[start:stop] = True
    return turning


def _averaged(values: Array) -> Array:
    """Running mean over about a second, shorter at the ends."""
    window = np.ones(min(_AVERAGED_STEPS, max(values.size, 1)))
    return np.convolve(values, window, "same") / np.convolve(np.ones(values.size), window, "same")


def _held(begins: Flags, goes_on: Flags) -> Flags:
    """From where `begins` holds until `goes_on` no longer does, whichever way one looks along time."""
    found = begins.copy()
    for start, stop in stretches(goes_on | begins):
        found[start:stop] = begins[start:stop].any()
    return found


def _runs(time: npt.NDArray[np.int64], kinds: Sequence[str]) -> Iterator[Manoeuvre]:
    first = 0
    for index in range(1, len(kinds) + 1):
        if index == len(kinds) or kinds[index] != kinds[first]:
            stop = int(time[index]) if index < len(kinds) else int(time[-1]) + STEP_US
            yield Manoeuvre(kinds[first], int(time[first]), stop)
            first = index


def _merged(runs: list[Manoeuvre], shortest_s: float) -> list[Manoeuvre]:
    """Stretches in the air that are too short become part of the longer neighbour there, the shortest first."""
    while True:
        short = [
            index
            for index, one in enumerate(runs)
            if one.kind != GROUND and one.seconds < shortest_s and _neighbours(runs, index)
        ]
        if not short:
            return runs
        index = min(short, key=lambda one: runs[one].seconds)
        into = max(_neighbours(runs, index), key=lambda one: runs[one].seconds)
        runs[index] = Manoeuvre(runs[into].kind, runs[index].start, runs[index].stop)
        runs = _joined(runs)


def _neighbours(runs: Sequence[Manoeuvre], index: int) -> list[int]:
    return [one for one in (index - 1, index + 1) if 0 <= one < len(runs) and runs[one].kind != GROUND]


def _joined(runs: Sequence[Manoeuvre]) -> list[Manoeuvre]:
    found: list[Manoeuvre] = []
    for one in runs:
        if found and found[-1].kind == one.kind and found[-1].stop == one.start:
            found[-1] = Manoeuvre(one.kind, found[-1].start, one.stop)
        else:
            found.append(one)
    return found


def _with_ends(runs: list[Manoeuvre], settings: ConformanceSettings) -> list[Manoeuvre]:
    """The climb from the ground is the take-off, the descent to it the landing, with what lies between and it."""
    runs = list(runs)
    for index, one in enumerate(runs):
        if one.kind != GROUND:
            continue
        for step, wanted, kind in ((1, CLIMB, TAKEOFF), (-1, DESCENT, LANDING)):
            edge = one.stop if step > 0 else one.start
            near = index + step
            while 0 <= near < len(runs) and runs[near].kind not in (GROUND, wanted) and _reach(runs[near], edge):
                near += step
            if 0 <= near < len(runs) and runs[near].kind == wanted:
                for other in range(index + step, near + step, step):
                    runs[other] = Manoeuvre(kind, runs[other].start, runs[other].stop)
    return _joined(runs)


def _reach(run: Manoeuvre, edge: int) -> bool:
    """Whether a stretch lies near the edge of the ground with all of it."""
    return max(abs(run.start - edge), abs(run.stop - edge)) <= _NEAR_GROUND_US
