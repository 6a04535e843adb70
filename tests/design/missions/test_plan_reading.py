"""What a plan of QGroundControl flies, what is kept of it, and which plans are refused."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.design.missions.made_plans import HOME, back, plan, simple, speed, survey, take_off, to, write

from fusetune.design.missions.mission import load_mission, mission_of_plan
from fusetune.design.missions.plan_reading import followed_plan
from fusetune.design.missions.plan_writing import document_of, write_mission_plan
from fusetune.design.missions.route import route_of
from fusetune.errors import UserError
from fusetune.px4.plan_file import read_plan
from fusetune.px4.plan_rules import plan_problems

ROI = simple(195, [0, 0, 0, 0, 47.398, 8.546, 0], mode=None)
CAMERA = simple(206, [25, 0, 1, 0, 0, 0, 0], frame=2, mode=None)
LAND = simple(21, [0, 0, 0, None, 0, 0, 0])
HOLD = simple(19, [12.5, 0, 0, 90, HOME[0] + 40 / 111_195.0, HOME[1], 20])


def everything() -> dict[str, Any]:
    """Waypoints by several ways to count altitude, a survey, a jump, camera, region of interest, fence, rally."""
    document = plan(
        take_off(12),
        speed(4),
        to(10, 0, radius=0.4),
        simple(16, [0, 0, 0, None, HOME[0] + 20 / 111_195.0, HOME[1], 510.0], frame=0, mode=2),
        simple(177, [3, 1, 0, 0, 0, 0, 0], frame=2, mode=None),
        CAMERA,
        survey(to(30, 0, 25), CAMERA, to(30, 50, 25)),
        ROI,
        HOLD,
        simple(93, [2.5, -1, -1, -1, 0, 0, 0], frame=2, mode=None),
        speed(-2),
        to(0, 30, yaw=-90.0),
        back(),
    )
    document["geoFence"]["circles"] = [{"circle": {"center": HOME[:2], "radius": 200}, "inclusion": True, "version": 1}]
    document["rallyPoints"]["points"] = [[47.398, 8.546, 30]]
    document["mission"]["items"][6]["KeyOfALaterVersion"] = {"a": [1, None]}
    return document


def test_items_are_followed_as_px4_flies_them(tmp_path: Path) -> None:
    mission = load_mission(write(tmp_path, everything()))
    assert mission.name == "field_one"
    assert mission.takeoff.altitude_m == 12.0
    legs = [leg for leg in route_of(mission) if leg.kind == "travel"]
    # both waypoints twice: one jump back to the first; the second is 510 m above sea level, home 488
    assert [round(leg.end[0]) for leg in legs] == [10, 20, 10, 20, 30, 30, 40, 0]
    assert [round(-leg.end[2]) for leg in legs] == [20, 22, 20, 22, 25, 25, 20, 20]
    assert [leg.speed_m_s for leg in legs] == [4.0] * 7 + [5.0]
    assert [leg.turn for leg in legs[:2]] == ["fly_over", "fly_by"]
    # held 12.5 s, and 2.5 s more by the delay
    assert (legs[6].hold_s, legs[6].heading_deg, legs[7].heading_deg) == (15.0, 90.0, -90.0)
    assert mission.landing.mode == "return"
    assert mission.fence is not None
    assert mission.fence.circles[0].radius_m == 200.0
    notes = " | ".join(mission.notes)
    for words in ("command 195) is kept as it is: it decides where the vehicle looks", "command 206", "1 rally point"):
        assert words in notes


def test_what_is_written_again_means_the_same_down_to_what_is_not_flown(tmp_path: Path) -> None:
    document = everything()
    write_mission_plan(load_mission(write(tmp_path, document)), tmp_path / "again.plan")
    assert json.loads((tmp_path / "again.plan").read_text(encoding="utf-8")) == json.loads(json.dumps(document))


@pytest.mark.parametrize(
    ("items", "mode"),
    [
        ((take_off(), to(10, 0), simple(17, [0, 0, 0, None, *HOME[:2], 20]), to(30, 0)), "pilot"),
        ((take_off(), to(10, 0)), "pilot"),
        ((take_off(), to(10, 0), LAND), "land"),
        ((take_off(), to(10, 0), back(), to(99, 0)), "return"),
    ],
)
def test_how_a_plan_ends(tmp_path: Path, items: tuple[dict[str, Any], ...], mode: str) -> None:
    mission = load_mission(write(tmp_path, plan(*items)))
    assert mission.landing.mode == mode
    assert all(leg.end[0] < 50.0 for leg in route_of(mission))


def test_landing_elsewhere_and_taking_off_elsewhere_are_ways_to_fly(tmp_path: Path) -> None:
    away = simple(22, [0, 0, 0, None, HOME[0] + 50 / 111_195.0, HOME[1], 15])
    land = simple(21, [0, 0, 0, None, HOME[0], HOME[1] + 40 / 75_270.0, 0])
    legs = route_of(load_mission(write(tmp_path, plan(away, to(10, 0), land))))
    assert [leg.kind for leg in legs] == ["takeoff", "travel", "travel", "travel", "descent"]
    assert [(round(leg.end[0]), round(leg.end[1])) for leg in legs] == [(0, 0), (50, 0), (10, 0), (0, 40), (0, 40)]
    assert [round(-leg.end[2]) for leg in legs] == [15, 15, 20, 20, 0]


@pytest.mark.parametrize(
    ("document", "words"),
    [
        (plan(take_off(), to(9, 0), firmwareType=3), ("ArduPilot", "firmwareType 3", "Plan it for PX4")),
        (plan(take_off(), to(9, 0), vehicleType=1), ("fixed-wing", "expected a multicopter")),
        (plan(take_off(), to(9, 0), vehicleType=22), ("a VTOL",)),
        (plan(to(9, 0), back()), ("without a take-off", "Put a take-off first")),
        (plan(take_off(), back()), ("flies to no waypoint",)),
        (plan(take_off(), simple(115, [90, 20, 1, 0, 0, 0, 0], 2, None), to(9, 0)),
         ("item 2", "PX4 refuses", "heading")),
        (plan(take_off(), simple(16, [0, 0, 0, None, 47.4, 8.54, 9], 10, 4)), ("above terrain", "item 2")),
        (plan(take_off(), to(9, 0), simple(177, [2, -1, 0, 0, 0, 0, 0], 2, None)), ("jumps back without end",)),
        (plan(take_off(), to(9, 0), simple(179, [1, 0, 0, 0, 0, 0, 0], 2, None)), ("moves home",)),
        (plan(take_off(), to(9, 0) | {"autoContinue": False}), ("autoContinue is false",)),
        (plan(take_off(), simple(84, [0, 0, 0, None, 47.4, 8.54, 9])), ("aircraft with wings",)),
        (plan(take_off(), to(9, 0, height=700)), ("item 2", "alt is 700", "between 1 and 500")),
        (plan(take_off(), to(90_000, 0)), ("90.0 km from home", "item 2")),
        (plan(take_off(), to(9, 0), {"type": "ComplexItem", "complexItemType": "StructureScan", "doJumpId": 3}),
         ("item 3 is a StructureScan", "QGroundControl makes them")),
        (plan(take_off(), survey(to(9, 0), kind="fwLandingPattern")), ("for aircraft with wings",)),
    ],
)  # fmt: skip
def test_other_plans_are_refused_with_reason_and_remedy(
    tmp_path: Path, document: dict[str, Any], words: tuple[str, ...]
) -> None:
    path = write(tmp_path, document)
    with pytest.raises(UserError) as error:
        load_mission(path)
    for one in (str(path), *words):
        assert one in str(error.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\xff\xfe", "is no JSON that can be meant"),
        (b"QGC WPL 110\n", "is no JSON that can be meant"),
        (b"[1]", "holds no JSON object"),
        (b'{"fileType": "Plan", "version": NaN}', "holds NaN"),
        (b'{"a": 1, "a": 2}', "'a' stands twice"),
        (b"[" * 100_000, "nests too deeply"),
        (b'{"fileType": "Parameters"}', "fileType is 'Parameters'"),
    ],
)
def test_what_is_no_plan_is_told(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "a.plan"
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"a\.plan") as error:
        read_plan(path)
    assert words in str(error.value)


JSON_VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-3, 300)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
    max_leaves=4,
)


def nodes(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    keys = value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in keys:
        yield (*place, key)
        yield from nodes(value[key], (*place, key))


def put(document: Any, place: tuple[Any, ...], value: Any) -> None:
    *way, last = place
    for key in way:
        document = document[key]
    document[last] = value


def read_or_refused(document: Any) -> None:
    """What obeys the rules is a mission that is written as it was, or refused in words."""
    if any(plan_problems(document)):
        return
    with suppress(UserError):
        mission = mission_of_plan(followed_plan(document, "a.plan"), "a.plan")
        assert document_of(mission) == document


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_whatever_stands_at_a_place_ends_in_a_mission_or_in_a_message(data: st.DataObject) -> None:
    document = copy.deepcopy(everything())
    put(document, data.draw(st.sampled_from(list(nodes(document)))), data.draw(JSON_VALUES))
    read_or_refused(document)


@pytest.mark.parametrize("value", [None, 0, -1, 1.5, "", [], {}, True], ids=repr)
def test_a_plain_value_at_any_place_ends_likewise(value: Any) -> None:
    for place in nodes(everything()):
        document = copy.deepcopy(everything())
        put(document, place, value)
        read_or_refused(document)
