"""A mission as a plan that QGroundControl opens."""

from __future__ import annotations

import os
from typing import Any

from fusetune.design.missions.fence import Fence
from fusetune.design.missions.mission import Mission, Waypoint, mission_of_plan
from fusetune.design.missions.plan_reading import FLY_OVER_ACCEPTANCE_M
from fusetune.px4.plan_file import (
    Plan,
    PlanCircle,
    PlanItem,
    PlanPolygon,
    PlanPosition,
    change_speed,
    land,
    plan_document,
    return_to_launch,
    take_off,
    waypoint,
    write_plan_document,
)


def write_mission_plan(mission: Mission, path: str | os.PathLike[str]) -> None:
    """Write the mission as a QGroundControl plan; one that was read from a plan is written as it was read.

    Raises
    ------
    ValueError
        The mission was read from a plan and flies otherwise by now.
    """
    write_plan_document(path, document_of(mission))


def document_of(mission: Mission) -> dict[str, Any]:
    """The JSON object of the plan; `ValueError` as of `write_mission_plan`."""
    if mission.plan is not None:
        if mission_of_plan(mission.plan, "plan").waypoints != mission.waypoints:
            raise ValueError("the waypoints are not those of the plan that the mission was read from")
        return dict(mission.plan.document)
    home, fence = mission.home, mission.fence or Fence()
    return plan_document(
        Plan(
            PlanPosition(home.lat, home.lon, home.alt),
            tuple(plan_items(mission)),
            hover_speed_m_s=mission.speed_m_s,
            circles=tuple(PlanCircle(one.lat, one.lon, one.radius_m, one.inside) for one in fence.circles),
            polygons=tuple(PlanPolygon(one.points, one.inside) for one in fence.polygons),
        )
    )


def plan_items(mission: Mission) -> list[PlanItem]:
    """Mission items: take-off, speed changes where the speed changes, waypoints, and the way down."""
    home = mission.home
    items = [
        take_off(PlanPosition(home.lat, home.lon, mission.takeoff.altitude_m)),
        change_speed(mission.waypoints[0].speed_m_s),
    ]
    speed_m_s = mission.waypoints[0].speed_m_s
    for point in mission.waypoints:
        if point.speed_m_s != speed_m_s:
            items.append(change_speed(point.speed_m_s))
            speed_m_s = point.speed_m_s
        items.append(_waypoint_item(point))
    last = mission.waypoints[-1]
    ends = {"return": [return_to_launch()], "land": [land(PlanPosition(last.lat, last.lon, 0.0))], "pilot": []}
    return [*items, *ends[mission.landing.mode]]


def _waypoint_item(point: Waypoint) -> PlanItem:
    return waypoint(
        PlanPosition(point.lat, point.lon, point.alt),
        hold_s=point.hold_s,
        acceptance_radius_m=FLY_OVER_ACCEPTANCE_M if point.turn == "fly_over" else 0.0,
        yaw_deg=point.heading_deg,
    )
