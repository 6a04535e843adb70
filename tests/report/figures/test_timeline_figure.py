"""A flight in time: bars, phases, test ratios."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from tests.report.made_health import END_S, LANDING_S, TAKE_OFF_S, logged_flight

from fusetune.report.figures.timeline_figure import draw_timeline
from fusetune.report.finding_bars import Bar

BARS = (Bar("vibration", "fail", 20.0, 32.5), Bar("GNSS velocity: rejected", "warning", 29.0, 31.0, is_cause=False))


@pytest.fixture(scope="module")
def figure() -> Figure:
    return draw_timeline(logged_flight(), BARS)


def spans(axes: Axes) -> list[tuple[float, float]]:
    """Extents in time of bars and shades."""
    return [(one.get_x(), one.get_x() + one.get_width()) for one in axes.patches]  # type: ignore[attr-defined]


def test_bars_lie_where_the_findings_are_and_the_flight_below(figure: Figure) -> None:
    lanes = figure.axes[0]
    assert spans(lanes) == [pytest.approx(one) for one in ((20.0, 32.5), (29.0, 31.0), (TAKE_OFF_S, LANDING_S))]
    assert [one.get_text() for one in lanes.get_yticklabels()] == [*(bar.words for bar in BARS), "in the air"]


def test_ground_is_grey_and_a_cause_lies_over_the_curves(figure: Figure) -> None:
    shaded = spans(figure.axes[1])
    assert shaded == [pytest.approx(one) for one in ((0.0, TAKE_OFF_S), (LANDING_S, END_S), (20.0, 32.5))]


def test_height_and_speeds_are_those_of_the_flight(figure: Figure) -> None:
    time, height = np.array(figure.axes[1].lines[0].get_xydata()).T
    assert height[np.searchsorted(time, 30.0)] == pytest.approx(10.0)
    across, up = figure.axes[2].lines
    assert np.allclose(across.get_ydata(), 1.0)
    assert np.array(up.get_ydata())[np.searchsorted(time, 15.0)] == pytest.approx(1.0)


def test_ratios_beyond_the_gate_are_seen(figure: Figure) -> None:
    ratios = figure.axes[3]
    line = next(one for one in ratios.lines if one.get_label() == "GNSS velocity")
    time, ratio = np.array(line.get_xydata()).T
    assert ratio.max() == 4.0
    assert np.ptp(time[ratio > 1.0]) == pytest.approx(2.0, abs=0.3)


def test_a_log_without_all_that_is_drawn_too() -> None:
    bare = logged_flight().with_topics({})
    panels = draw_timeline(bare, ()).axes
    assert [one.get_text() for one in panels[0].get_yticklabels()] == ["not known to fly"]
    assert "no local position" in panels[1].texts[0].get_text()
    assert "no innovations" in panels[3].texts[0].get_text()
