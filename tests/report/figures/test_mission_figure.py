"""The map of a mission and its profile: what is drawn where."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection

from fusetune.design.missions.limits import PX4_LIMITS
from fusetune.design.missions.mission import Mission, mission_of
from fusetune.design.missions.outlook import outlook
from fusetune.report.figures.drawing import figure_style
from fusetune.report.figures.mission_figure import draw_mission, mission_figure
from fusetune.report.sections.mission_section import mission_section
from fusetune.storage.documents import write_document


@pytest.fixture(scope="module")
def mission() -> Mission:
    document = {
        "name": "mapped",
        "description": "Round a corner & up.",
        "home": {"lat": 47.0, "lon": 8.0, "alt": 400},
        "takeoff": {"altitude_m": 10},
        "landing": {"mode": "return"},
        "waypoints": [
            {"north_m": 40, "east_m": 0, "alt": 10},
            {"north_m": 40, "east_m": 30, "alt": 16, "turn": "fly_over"},
        ],
        "shapes": [{"kind": "yaw_turns", "altitude_m": 16, "north_m": 20, "east_m": 30}],
        "fence": {"max_distance_m": 80, "circles": [{"north_m": 10, "east_m": 10, "radius_m": 2, "inside": False}]},
    }
    return mission_of(document, "mapped.yaml")


def test_the_map_has_the_path_the_waypoints_and_the_fence(mission: Mission) -> None:
    with figure_style():
        plan, bar, height, speed, heading = _axes(mission)
    (path,) = [one for one in plan.collections if isinstance(one, LineCollection)]
    places = np.concatenate(path.get_segments())
    assert np.abs(places).max() < 80.0
    # east to the right, north up; the corner of the first waypoint is cut, the second is crossed
    assert np.hypot(places[:, 0] - 0.0, places[:, 1] - 40.0).min() > 1.0
    assert np.hypot(places[:, 0] - 30.0, places[:, 1] - 40.0).min() < 0.3
    texts = [text.get_text() for text in plan.texts]
    assert texts == ["1", "2", "3–9"]
    assert [patch.get_radius() for patch in plan.patches] == [80.0, 2.0]
    labels = {text.get_text() for text in plan.get_legend().get_texts()}
    assert labels == {"straight legs", "stop", "fly over", "fly by", "home", "fence"}
    assert "speed" in bar.get_xlabel()
    # crossing the second waypoint it climbs on behind it
    assert 16.0 < height.lines[0].get_ydata().max() < 18.5
    assert speed.lines[0].get_ydata().max() == pytest.approx(5.0, abs=0.3)
    assert np.ptp(heading.lines[0].get_ydata()) > 350.0


def _axes(mission: Mission):
    figure = mission_figure(mission, PX4_LIMITS)
    plan, height, speed, heading = (one for one in figure.axes if one.get_label() != "<colorbar>")
    (bar,) = [one for one in figure.axes if one.get_label() == "<colorbar>"]
    return plan, bar, height, speed, heading


def test_the_section_answers_first_and_lists_the_legs(mission: Mission, tmp_path: Path) -> None:
    draw_mission(mission, PX4_LIMITS, tmp_path / "mapped.svg")
    write_document(tmp_path / "mapped.json", outlook(mission).document())
    section = mission_section(tmp_path / "mapped.json")
    assert section.index("Mission mapped: ") < section.index("Round a corner &amp; up.") < section.index("Legs")
    assert section.count("<tr>") == 1 + 12
    assert "GF_MAX_HOR_DIST" in section
    assert mission_section(None) == ""
    again = tmp_path / "again.svg"
    draw_mission(mission, PX4_LIMITS, again)
    assert again.read_bytes() == (tmp_path / "mapped.svg").read_bytes()
