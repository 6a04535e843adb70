"""`fusetune mission`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from fusetune.cli.command import DONE
from fusetune.cli.output.json_document import add_json, print_document

if TYPE_CHECKING:
    from fusetune.design.missions.mission import Mission
    from fusetune.design.missions.outlook import Outlook, PlannedVehicle

HELP = "check a mission or make one: legs, duration, battery, plan for QGroundControl, map"
EXAMPLES = (
    (
        "fusetune mission config/missions/excite.yaml --out excite.plan --map excite.png",
        "check it, write the plan, draw the map",
    ),
    ("fusetune mission --for EKF2_GPS_DELAY --home 47.4,8.5,490 --out delay.plan", "a mission that tells a delay"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Mission or what it is made of, vehicle, plan, map."""
    parser.add_argument("file", type=Path, nargs="?", metavar="MISSION", help="mission (.yaml) or plan (.plan)")
    parser.add_argument(
        "--shape",
        action="append",
        default=[],
        metavar="KEYS",
        help='shape as in a mission file, "kind: hover, altitude_m: 10, duration_s: 60"; may be given several times',
    )
    parser.add_argument(
        "--for", dest="purpose", default="", metavar="NAMES", help="parameters to tell apart, with commas between"
    )
    parser.add_argument(
        "--home", type=_home, metavar="LAT,LON,ALT", help="home without FILE: degrees, and m above mean sea level"
    )
    parser.add_argument("--name", metavar="NAME", help="name of the mission")
    parser.add_argument("--speed", type=float, metavar="M_S", help="horizontal speed (5)")
    parser.add_argument("--field", type=float, metavar="M", help="side of the square for a purpose (60)")
    parser.add_argument("--vehicle", type=Path, metavar="VEHICLE.yaml", help="vehicle to plan for (PX4's defaults)")
    parser.add_argument("--out", type=Path, metavar="FILE.plan", help="plan to write")
    parser.add_argument("--map", type=Path, metavar="FILE.png", help="map and profile to draw, .png or .svg")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Check, tell, and write what is asked for; always `DONE`."""
    from fusetune.design.missions.asked_mission import asked_mission
    from fusetune.design.missions.outlook import outlook
    from fusetune.design.missions.plan_reading import PLAN_SUFFIX
    from fusetune.design.missions.plan_writing import write_mission_plan
    from fusetune.errors import UserError
    from fusetune.execute.planned_vehicle import planned_vehicle

    if options.out is not None and options.out.suffix.casefold() != PLAN_SUFFIX:
        raise UserError(options.out, "is no plan", "Name a file that ends with .plan")
    if options.map is not None and options.map.suffix.casefold() not in (".png", ".svg"):
        raise UserError(options.map, "is no picture", "Name a file that ends with .png or .svg")
    asked = {"name": options.name, "speed_m_s": options.speed, "field_m": options.field}
    keys = {key: value for key, value in asked.items() if value is not None}
    purpose = [one.strip() for one in options.purpose.split(",") if one.strip()]
    mission = asked_mission(options.file, options.shape, purpose, options.home, **keys)
    vehicle = planned_vehicle(options.vehicle)
    found = outlook(mission, vehicle, file=options.file or "the mission")
    if not options.json:
        print(*_lines(mission, found, vehicle), sep="\n")
    if options.out is not None:
        write_mission_plan(mission, options.out)
        if not options.json:
            print(f"Plan, for QGroundControl: {options.out}")
    if options.map is not None:
        from fusetune.report.figures.mission_figure import draw_mission

        draw_mission(mission, vehicle.limits, options.map)
        if not options.json:
            print(f"Map: {options.map}")
    if options.json:
        print_document({"answer": found.answer, "outlook": found, "plan": options.out, "map": options.map})
    return DONE


def _home(text: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 3:
        raise argparse.ArgumentTypeError(f"{text!r} is not LAT,LON,ALT")
    return numbers


def _lines(mission: Mission, found: Outlook, vehicle: PlannedVehicle) -> Iterator[str]:
    yield found.answer
    head = ("leg", "from", "to", "length", "height", "speed", "")
    yield " " + f"{head[0]:<14}{head[1]:>7}{head[2]:>7}{head[3]:>9}{head[4]:>9}{head[5]:>10}"
    for leg in found.legs:
        extras = [leg.turn.replace("_", " ")] if leg.turn else []
        extras += [f"hold {leg.hold_s:g} s"] if leg.hold_s else []
        extras += [f"heading {leg.heading_deg:g}°"] if leg.heading_deg is not None else []
        yield (
            f" {leg.name:<14}{leg.start_s:>5.0f} s{leg.end_s:>5.0f} s{leg.length_m:>7.1f} m{leg.height_m:>7.1f} m"
            f"{leg.speed_m_s:>6.1f} m/s  {', '.join(extras)}"
        ).rstrip()
    yield from _purpose_lines(mission)
    if mission.purpose:
        yield _motion_line(mission, vehicle)
    yield from (f"Note: {note}." for note in found.notes)


def _purpose_lines(mission: Mission) -> Iterator[str]:
    from fusetune.design.missions.purpose import MOTIONS, motions_for

    for kind, names in motions_for(mission.purpose).items():
        yield f"For {', '.join(names)}: {kind}; {MOTIONS[kind].why}."


def _motion_line(mission: Mission, vehicle: PlannedVehicle) -> str:
    from fusetune.analyze.flight.excitation import excitation
    from fusetune.design.missions.flown_path import flown_path
    from fusetune.design.missions.outlook import attitude_of, motion_of
    from fusetune.design.missions.purpose import BRISK_M_S2, TURNING_DEG_S

    motion = motion_of(flown_path(mission, vehicle.limits))
    time_us = (1e6 * motion.time_s).astype("int64")
    moved = excitation(time_us, motion.velocity, attitude_of(motion), [(int(time_us[0]), int(time_us[-1]))])
    assert moved is not None
    turning = max(moved.yaw_rate_deg_s, moved.roll_pitch_rate_deg_s)
    return (
        f"Moves: {moved.horizontal_acceleration_m_s2:.1f} m/s² RMS horizontally ({BRISK_M_S2:g} tells the delay), "
        f"{turning:.0f} °/s RMS turning ({TURNING_DEG_S:g} tells lever arms), "
        f"{100.0 * moved.hover_share:.0f} % of the time hovering."
    )
