"""QGroundControl's mission files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fusetune.px4.plan_file import (
    Plan,
    PlanPosition,
    change_speed,
    land,
    return_to_launch,
    take_off,
    waypoint,
    write_plan,
)

HOME = PlanPosition(47.4, 8.5, 488.0)
CORNER = PlanPosition(47.401, 8.501, 20.0)


def plan_as_read(folder: Path) -> dict:
    items = (take_off(CORNER), change_speed(5.0), waypoint(CORNER, 2.0), return_to_launch(), land(CORNER))
    write_plan(folder / "survey.plan", Plan(HOME, items, hover_speed_m_s=5.0))
    return json.loads((folder / "survey.plan").read_text())


def test_plan_has_what_qgroundcontrol_asks_for(tmp_path: Path) -> None:
    plan = plan_as_read(tmp_path)
    assert (plan["fileType"], plan["version"]) == ("Plan", 1)
    assert (plan["geoFence"]["version"], plan["rallyPoints"]["version"]) == (2, 2)
    mission = plan["mission"]
    assert (mission["version"], mission["firmwareType"], mission["vehicleType"]) == (2, 12, 2)
    assert mission["plannedHomePosition"] == [47.4, 8.5, 488.0]
    assert mission["hoverSpeed"] == 5.0
    assert {"cruiseSpeed", "globalPlanAltitudeMode"} <= mission.keys()


def test_items_count_from_one_and_carry_seven_parameters(tmp_path: Path) -> None:
    items = plan_as_read(tmp_path)["mission"]["items"]
    assert [item["command"] for item in items] == [22, 178, 16, 20, 21]
    assert [item["doJumpId"] for item in items] == [1, 2, 3, 4, 5]
    assert all(item["type"] == "SimpleItem" and len(item["params"]) == 7 for item in items)
    assert items[2]["params"] == [2.0, 0.0, 0.0, None, 47.401, 8.501, 20.0]
    assert items[1]["params"][:3] == [1.0, 5.0, -1.0]
    assert [item["frame"] for item in items] == [3, 2, 3, 2, 3]
    assert items[2]["Altitude"] == 20.0


def test_numbers_that_json_lacks_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="JSON"):
        write_plan(tmp_path / "a.plan", Plan(PlanPosition(float("nan"), 0.0, 0.0), ()))
    assert not (tmp_path / "a.plan").exists()
