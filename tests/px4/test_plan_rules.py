"""The rules of QGroundControl's plans: each is broken once, in a plan that keeps them all."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from tests.design.missions.made_plans import back, plan, simple, speed, survey, take_off, to

from fusetune.px4.plan_rules import plan_problems

WHOLE = plan(
    take_off(), speed(4), to(10, 0), simple(177, [3, 2, 0, 0, 0, 0, 0], frame=2, mode=None),
    survey(to(20, 0), to(20, 9)), back(),
)  # fmt: skip
WHOLE["geoFence"] |= {
    "circles": [{"circle": {"center": [47.4, 8.5], "radius": 90.5}, "inclusion": True, "version": 1}],
    "polygons": [{"polygon": [[47.0, 8.0], [47.1, 8.0], [47.1, 8.1]], "inclusion": False, "version": 1}],
    "breachReturn": [47.4, 8.5, 30],
}
WHOLE["rallyPoints"]["points"] = [[47.4, 8.5, 30]]

BREAKS: list[tuple[str, Any, str]] = [
    ("fileType", "Mission", "fileType"),
    ("version", 2, "version is 2; expected 1"),
    ("mission", [], "mission is a list of 0"),
    ("mission.version", 1, "mission.version is 1; expected 2"),
    ("mission.firmwareType", "PX4", "mission.firmwareType"),
    ("mission.hoverSpeed", 0, "mission.hoverSpeed is 0; expected a number greater than 0"),
    ("mission.cruiseSpeed", None, "mission.cruiseSpeed"),
    ("mission.globalPlanAltitudeMode", 7, "mission.globalPlanAltitudeMode is 7"),
    ("mission.plannedHomePosition", [47.0, 8.0], "mission.plannedHomePosition"),
    ("mission.plannedHomePosition.0", 91.0, "mission.plannedHomePosition[0] is 91.0; expected -90 to 90"),
    ("mission.items", [], "expected a list of at least one item"),
    ("mission.items.2.type", "missionItem", "mission.items[2].type"),
    ("mission.items.2.autoContinue", 1, "mission.items[2].autoContinue"),
    ("mission.items.2.command", "16", "mission.items[2].command"),
    ("mission.items.2.frame", 99, "mission.items[2].frame is 99"),
    ("mission.items.2.frame", 2, "expected a global one for command 16"),
    ("mission.items.2.frame", 0, "AltitudeMode is 1 and its frame 0; expected frame 3 or 6"),
    ("mission.items.2.doJumpId", 2, "doJumpId is 2, after 2; expected ascending"),
    ("mission.items.2.doJumpId", 0, "doJumpId is 0; expected a whole number from 1"),
    ("mission.items.2.params", [0, 0, 0, None, 47.0, 8.0], "mission.items[2].params is a list of 6"),
    ("mission.items.2.params.0", None, "params[0] is null"),
    ("mission.items.2.params.0", -1, "expected a time from 0 s"),
    ("mission.items.2.params.1", -2, "expected an acceptance radius"),
    ("mission.items.2.params.4", "47", "params[4] is '47'; expected a number or null"),
    ("mission.items.2.params.4", 1e9, "params[4] is 1000000000.0; expected -90 to 90"),
    ("mission.items.2.params.5", -181, "params[5] is -181; expected -180 to 180"),
    ("mission.items.2.Altitude", 25.0, "Altitude is 25 and params[6] 20"),
    ("mission.items.2.AltitudeMode", 9, "AltitudeMode is 9"),
    ("mission.items.1.params.1", 0, "expected a speed greater than 0 m/s"),
    ("mission.items.1.params.0", 8, "expected 0 to 3"),
    ("mission.items.0.command", 16, "is a take-off behind"),
    ("mission.items.3.params.0", 40, "mission.items[3].params[0] is 40; expected the doJumpId of an item"),
    ("mission.items.4.complexItemType", 3, "mission.items[4].complexItemType"),
    ("mission.items.4.TransectStyleComplexItem.Items", None, "has no list Items"),
    ("mission.items.4.TransectStyleComplexItem.Items.0.params", [], "TransectStyleComplexItem.Items[0].params"),
    ("geoFence.version", 1, "geoFence.version is 1; expected 2"),
    ("geoFence.circles", None, "geoFence.circles"),
    ("geoFence.circles.0.circle.radius", 0, "geoFence.circles[0].circle.radius is 0"),
    ("geoFence.circles.0.inclusion", "yes", "geoFence.circles[0].inclusion"),
    ("geoFence.polygons.0.polygon", [[47.0, 8.0], [47.1, 8.0]], "expected at least 3 corners"),
    ("geoFence.polygons.0.polygon.1", [47.0], "geoFence.polygons[0].polygon[1]"),
    ("geoFence.breachReturn", [47.4, 8.5], "geoFence.breachReturn"),
    ("rallyPoints.points.0", [47.4, 8.5], "rallyPoints.points[0]"),
    ("rallyPoints.version", 1, "rallyPoints.version is 1"),
]  # fmt: skip
"""Where the plan is changed, to what, and what has to be said."""


def changed(place: str, value: Any) -> dict[str, Any]:
    document = copy.deepcopy(WHOLE)
    *way, last = [int(part) if part.isdigit() else part for part in place.split(".")]
    inner: Any = document
    for part in way:
        inner = inner[part]
    if place == "mission.items.0.command":
        # a second take-off further on: the first item with a place is no take-off any more
        document["mission"]["items"][2]["command"] = 22
    inner[last] = value
    return document


def test_a_plan_that_keeps_the_rules_has_no_problem() -> None:
    assert list(plan_problems(WHOLE)) == []


@pytest.mark.parametrize(
    ("place", "value", "said"), BREAKS, ids=[f"{place}={value}"[:60] for place, value, _ in BREAKS]
)
def test_each_broken_rule_is_told_with_its_place(place: str, value: Any, said: str) -> None:
    problems = list(plan_problems(changed(place, value)))
    assert any(said in one for one in problems), problems
