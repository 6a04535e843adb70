"""Which waypoints a flight passed, and how far it was beside its legs, where both are known: docs/conformance.md.

python -m benchmarks.conformance [--flights N] [--receiver rtk|consumer|both]

Simulated flights of five shapes in gusts, two of them flown otherwise than they are asked about: of one a waypoint is
left out, of another two are swapped. Each waypoint must be decided right, and the distance beside each leg be that of
the vehicle's true path, which is computed here by other means from the simulator's ground truth: once with the
vehicle's own estimate, once with the smoothed track.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fusetune.analyze.conformance.conformance import Conformance, conformance
from fusetune.analyze.conformance.flown_legs import FlownLeg, bends_of
from fusetune.analyze.conformance.flown_track import flown_track
from fusetune.analyze.conformance.settings import DEFAULTS
from fusetune.analyze.conformance.smoothed_track import smoothed_track
from fusetune.analyze.conformance.waypoint_passes import WaypointPass
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.design.missions.mission import Home, Landing, Mission, Takeoff, Turn, Waypoint
from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache
from fusetune.execute.simulation import fly
from fusetune.execute.vehicle import GnssError, Vehicle, load_vehicle
from fusetune.execute.world.flight_plan import plan_flight
from fusetune.px4.flight import Flight
from fusetune.px4.local_map import LocalMap

Array = npt.NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
VEHICLE = ROOT / "config" / "vehicles" / "quadrotor.yaml"
HOME = Home(47.397742, 8.545594, 488.0, 47.4, 20.0)
RECEIVERS = ("rtk", "consumer")


@dataclass(frozen=True)
class Corner:
    """A waypoint in metres north and east of home and above it."""

    north: float
    east: float
    up: float
    turn: Turn = "fly_by"
    hold_s: float = 0.0
    speed_m_s: float | None = None


def lanes() -> tuple[Corner, ...]:
    """Four survey lanes of 80 m, 20 m apart."""
    ends = ((10.0, 90.0), (90.0, 10.0))
    return tuple(Corner(north, 20.0 * lane, 20.0) for lane in range(4) for north in ends[lane % 2])


def box() -> tuple[Corner, ...]:
    """A square of 50 m, once cut and once crossed at its corners."""
    corners = ((50.0, 0.0), (50.0, 50.0), (0.0, 50.0), (0.0, 0.0))
    turns: tuple[Turn, ...] = ("fly_by", "fly_over")
    return tuple(Corner(north, east, 15.0, turn) for turn in turns for north, east in corners)


def figure_eight() -> tuple[Corner, ...]:
    """Two circles of 30 m in twelve chords each, flown in opposite senses through the same centre."""
    angles = np.arange(1, 13) * math.tau / 12
    radius = 30.0
    right = [(radius * math.sin(one), radius * (1.0 - math.cos(one))) for one in angles]
    left = [(radius * math.sin(one), -radius * (1.0 - math.cos(one))) for one in angles]
    return tuple(Corner(round(north, 6), round(east, 6), 18.0, speed_m_s=4.0) for north, east in (*right, *left))


def climb_steps() -> tuple[Corner, ...]:
    """Up a tower in steps of 8 m with a hold at each, aside, and down in steps of 12 m."""
    up = [Corner(20.0, 0.0, height, hold_s=4.0) for height in (10.0, 18.0, 26.0, 34.0)]
    down = [Corner(20.0, 25.0, height, hold_s=3.0) for height in (34.0, 22.0, 10.0)]
    return (*up, *down)


def runs() -> tuple[Corner, ...]:
    """To and fro along north and east, twice, the second time fast; stops at each end."""
    ends = ((60.0, 0.0), (0.0, 0.0), (0.0, 60.0), (0.0, 0.0))
    return tuple(
        Corner(north, east, 12.0, hold_s=2.0, speed_m_s=speed) for speed in (5.0, 10.0) for north, east in ends
    )


SHAPES = {"lanes": lanes, "box": box, "figure_eight": figure_eight, "climb_steps": climb_steps, "runs": runs}


def mission_of(name: str, corners: Sequence[Corner], speed_m_s: float = 6.0) -> Mission:
    """A mission around `HOME`, landing there."""
    local = LocalMap(HOME.lat, HOME.lon)
    waypoints = tuple(
        Waypoint(
            *local.to_global(one.north, one.east),
            one.up,
            speed_m_s if one.speed_m_s is None else one.speed_m_s,
            one.turn,
            one.hold_s,
        )
        for one in corners
    )
    return Mission(name, HOME, Takeoff(corners[0].up, 2.0), waypoints, Landing("return", 1.2), speed_m_s)


@dataclass(frozen=True)
class Flown:
    """A flight of the benchmark.

    Attributes
    ----------
    asked : the mission it is compared with
    order : waypoints of it, by index, in the order in which they were flown
    """

    name: str
    asked: Mission
    order: tuple[int, ...]
    seed: int

    @property
    def mission(self) -> Mission:
        """What was flown."""
        return replace(self.asked, waypoints=tuple(self.asked.waypoints[index] for index in self.order))

    @property
    def in_order(self) -> tuple[bool, ...]:
        """Of each waypoint of the mission whether it was passed in its turn; those swapped were not."""
        place = {index: number for number, index in enumerate(self.order)}
        return tuple(
            index in place
            and all((other < index) == (place[other] < place[index]) for other in self.order if other != index)
            for index in range(len(self.asked.waypoints))
        )


def flights(count: int = 20) -> Iterator[Flown]:
    """Each shape in turn; of the seventh flight a waypoint is left out, of the eleventh two are swapped."""
    for number in range(count):
        name = list(SHAPES)[number % len(SHAPES)]
        mission = mission_of(name, SHAPES[name]())
        order = list(range(len(mission.waypoints)))
        if number == 6:
            del order[2]
        if number == 10:
            order[3], order[4] = order[4], order[3]
        yield Flown(f"{number:02}_{name}", mission, tuple(order), 100 + number)


def vehicle_with(receiver: str) -> Vehicle:
    """The quadrotor in its gusts, with the receiver it has or one that takes corrections from a base station."""
    vehicle = load_vehicle(VEHICLE)
    if receiver == "consumer":
        return vehicle
    gnss = vehicle.gnss
    return replace(
        vehicle,
        gnss=replace(
            gnss,
            position=GnssError(0.01, 0.01, 60.0, 1.5),
            reported=replace(gnss.reported, eph_m=0.02, epv_m=0.03),
        ),
    )


@dataclass(frozen=True)
class Judged:
    """A flight beside what is known of it.

    Attributes
    ----------
    wrong : waypoints that were decided wrong, by index
    errors : (L, 3) of each leg the error of the distance beside it, its mean, 95 % and maximum, m
    receiver : (L,) what of the mean, with its sign, the receiver's own error explains; NaN of vertical legs
    signed : (L,) error of the mean with its sign
    """

    verdict: str
    wrong: tuple[int, ...]
    waypoints: int
    errors: Array
    receiver: Array
    signed: Array


def judge(flown: Flown, vehicle: Vehicle, flight: Flight, found: Conformance) -> Judged:
    """Hold what was found against the order that was flown, and against the true path."""
    wrong = tuple(
        index
        for index, one in enumerate(found.passes)
        if one.is_passed != (index in flown.order) or one.in_order != flown.in_order[index]
    )
    rows = []
    for index, leg in enumerate(found.legs):
        if leg.figures is None or leg.planned.kind != "travel":
            continue
        window = _window(flown, vehicle, leg, found.passes)
        bends = bends_of(index, found.passes)
        truth, right = _beside(flight, leg, window, bends)
        told = (leg.figures.cross_track_mean, leg.figures.cross_track_95, leg.figures.cross_track_max)
        rows.append((*(abs(one - true) for one, true in zip(told, truth, strict=True)),
                     leg.figures.cross_track_bias - right, _receiver_error(flight, leg, window)))  # fmt: skip
    table = np.array(rows)
    return Judged(found.verdict, wrong, len(found.passes), table[:, :3], table[:, 4], table[:, 3])


def _window(flown: Flown, vehicle: Vehicle, leg: FlownLeg, passes: Sequence[WaypointPass]) -> tuple[float, float]:
    """When the plan of the simulator flies a leg that ends at a waypoint, s since boot."""
    path = plan_flight(flown.mission, vehicle.limits).path
    waypoint = leg.planned.waypoint
    assert waypoint is not None, "a leg of travel ends at a waypoint"
    place = flown.order.index(waypoint)
    ends = _knots(flown, path.knots)
    start_s = float(path.times_s[ends[place - 1][1] if place else 2])
    stop_s = float(path.times_s[ends[place][0]])
    # a stop is reached, and left, half of the filter's window later and earlier than its knots say
    stopped = place > 0 and passes[flown.order[place - 1]].planned.is_stop
    return (
        start_s - path.half_window_s * (stopped or not place),
        stop_s + path.half_window_s * passes[waypoint].planned.is_stop,
    )


def _knots(flown: Flown, knots: Array) -> list[tuple[int, int]]:
    """First and last knot at each waypoint, in the order in which they were flown."""
    local, found, row = LocalMap(HOME.lat, HOME.lon), [], 2
    for one in flown.mission.waypoints:
        target = np.array([*local.to_local(one.lat, one.lon), -one.alt])
        # the simulator's map is that of the ellipsoid: 0.4 % longer
        near = np.linalg.norm(knots - target, axis=1) < 1.0
        first = row + int(np.argmax(near[row:]))
        last = first + (1 if first + 1 < len(knots) and near[first + 1] else 0)
        found.append((first, last))
        row = last + 1
    return found


def _beside(
    flight: Flight, leg: FlownLeg, window: tuple[float, float], bends: tuple[float, float]
) -> tuple[tuple[float, float, float], float]:
    """Mean, 95 % and maximum of the true distance beside a leg, and the mean with its sign, by complex numbers."""
    table = flight.topics["vehicle_local_position_groundtruth", 0]
    rows = (table["timestamp"] >= window[0] * 1e6) & (table["timestamp"] <= window[1] * 1e6)
    north, east, down = (table[name][rows].astype(np.float64) for name in "xyz")
    start, end = leg.planned.start, leg.planned.end
    way = complex(end[0] - start[0], end[1] - start[1])
    if abs(way) > 1.0:
        turned = (north - start[0] + 1j * (east - start[1])) / (way / abs(way))
        along, across, length = turned.real, turned.imag, abs(way)
    else:
        along, length = np.abs(down - start[2]), abs(end[2] - start[2])
        across, bends = np.abs(north - start[0] + 1j * (east - start[1])), (DEFAULTS.height_m, DEFAULTS.height_m)
    first, last = (min(one, 0.4 * length) for one in bends)
    across = across[(along >= first) & (along <= length - last)]
    beside = np.abs(across)
    return (float(beside.mean()), float(np.quantile(beside, 0.95)), float(beside.max())), float(across.mean())


def _receiver_error(flight: Flight, leg: FlownLeg, window: tuple[float, float]) -> float:
    """Mean error of the receiver's positions across a leg, right of it above 0, m."""
    way = np.subtract(leg.planned.end, leg.planned.start)[:2]
    length = float(np.hypot(*way))
    if length <= 1.0:
        return math.nan
    table, truth = flight.topics["vehicle_gps_position", 0], flight.topics["vehicle_local_position_groundtruth", 0]
    time = table["timestamp"] - round(1e3 * flight.parameters.initial["EKF2_GPS_DELAY"])
    rows = (time >= window[0] * 1e6) & (time <= window[1] * 1e6)
    local = LocalMap(HOME.lat, HOME.lon)
    columns = (table[name][rows].tolist() for name in ("latitude_deg", "longitude_deg"))
    received = np.array([local.to_local(*place) for place in zip(*columns, strict=True)])
    true = np.column_stack([np.interp(time[rows], truth["timestamp"], truth[name]) for name in "xy"])
    return float(np.mean((received - true) @ np.array([-way[1], way[0]]) / length))


def flown_and_judged(flown: Flown, receiver: str, *, smoothed: bool = True) -> dict[str, Judged]:
    """Fly, and judge what is found by the vehicle's own estimate and, if asked for, by the smoothed track."""
    vehicle = vehicle_with(receiver)
    observed = ObservedFlight(fly(flown.mission, vehicle, {}, flown.seed, name=flown.name))
    track = flown_track(observed.flight)
    assert track is not None, "a simulated flight has a place on earth"
    tracks = {"estimate": track} | ({"smoothed": smoothed_track(observed, track)} if smoothed else {})
    return {
        name: judge(flown, vehicle, observed.flight, conformance(observed.flight, one, flown.asked))
        for name, one in tracks.items()
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Fly all, print a line for each, and the worst."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--flights", type=int, default=20)
    parser.add_argument("--receiver", choices=(*RECEIVERS, "both"), default="both")
    options = parser.parse_args(arguments)
    use_kernel_cache()
    for receiver in RECEIVERS if options.receiver == "both" else (options.receiver,):
        judged: dict[str, list[Judged]] = {}
        print(f"\nreceiver: {receiver}; errors of the distance beside a leg in m: mean / 95 % / maximum, worst leg")
        print("| flight | verdict | waypoints right | by the estimate | smoothed |\n|---|---|---|---|---|")
        for flown in flights(options.flights):
            found = flown_and_judged(flown, receiver)
            for name, one in found.items():
                judged.setdefault(name, []).append(one)
            right = " and ".join(
                dict.fromkeys(f"{one.waypoints - len(one.wrong)} of {one.waypoints}" for one in found.values())
            )
            errors = [" / ".join(f"{worst:.3f}" for worst in one.errors.max(axis=0)) for one in found.values()]
            print(f"| {flown.name} | {found['smoothed'].verdict} | {right} | {' | '.join(errors)} |", flush=True)
        for name, each in judged.items():
            errors = np.concatenate([one.errors for one in each])
            signed, own = (np.concatenate([getattr(one, what) for one in each]) for what in ("signed", "receiver"))
            level = np.isfinite(own)
            wrong, total = sum(len(one.wrong) for one in each), sum(one.waypoints for one in each)
            worst, usual = (list(one.round(3).tolist()) for one in (errors.max(axis=0), np.median(errors, axis=0)))
            print(f"{name}: {wrong} of {total} waypoints wrong; {len(errors)} legs, worst {worst}, median {usual}")
            print(
                f"  mean beside {np.count_nonzero(level)} level legs, RMS: error {_rms(signed[level]):.3f}, "
                f"receiver's own {_rms(own[level]):.3f}, what that leaves {_rms(signed[level] - own[level]):.3f}"
            )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


if __name__ == "__main__":
    main()
