"""What is drawn of a search."""

from __future__ import annotations

import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from tests.report.made_search import made_search, part

from fusetune.report.figures.found_figure import found_figure
from fusetune.report.figures.gain_figures import kept_aside_figure, shrinkage_figure


def places(axes: Axes, label: str) -> list[float]:
    """Where the marks of a row's kind are; only the first row names them."""
    first = next(line for line in axes.lines if line.get_label() == label)
    alike = [
        line
        for line in axes.lines
        if line.get_marker() == "o" and line.get_markerfacecolor() == first.get_markerfacecolor()
    ]
    return [float(line.get_xdata()[0]) for line in alike]


def names(axes: Axes) -> list[str]:
    return [label.get_text() for label in axes.get_yticklabels()]


def title(figure: Figure) -> str:
    return str(figure.get_suptitle())


def test_shrinkage_tells_how_much_was_luck_in_all_and_for_each_part() -> None:
    figure = shrinkage_figure(made_search())
    (axes,) = figure.axes
    # 8 is the mean of what the two searches promised, 4 what was left on the flights kept aside
    assert places(axes, "on the flights that the search saw") == [8.0, 10.0, 6.0]
    assert places(axes, "on the flights kept aside from it") == [4.0, 2.0, 6.0]
    assert names(axes) == ["mean of all parts", "part 1 kept aside (2 flights)", "part 2 kept aside (2 flights)"]
    assert title(figure).startswith("50 % of the gain was luck: gain +8.0 %")


@pytest.mark.parametrize(
    ("seen", "aside", "answer"),
    [
        (10.0, -1.0, "All of the gain was luck"),
        (10.0, 12.0, "No luck in it"),
        (-0.5, -1.0, "The search found no gain"),
    ],
)
def test_shrinkage_answers_first(seen: float, aside: float, answer: str) -> None:
    searches = [part("without part 1", ("a",), seen, aside, 0.1)]
    assert title(shrinkage_figure(made_search(searches=searches, gain_kept_aside_percent=aside))).startswith(answer)


def test_a_bar_for_each_flight_and_the_expected_gain_with_its_interval() -> None:
    figure = kept_aside_figure(made_search())
    (axes,) = figure.axes
    assert [bar.get_width() for bar in axes.patches if bar.get_height() < 1.0] == [6.0, -2.0, 5.0, 7.0]
    assert names(axes) == ["a", "b", "c", "d"]
    assert title(figure) == "Better on 3 of 4 flights that the search did not see; expect +4.0 % (−1.0 to +9.0)"


def test_an_interval_far_wider_than_all_bars_does_not_squeeze_them() -> None:
    expected = {"percent": 4.0, "lower_percent": -469.0, "upper_percent": 83.0}
    (axes,) = kept_aside_figure(made_search(expected_gain=expected)).axes
    # twice the longest bar, and a margin of 9 % of the whole width
    assert axes.get_xlim() == pytest.approx((-14.0 - 0.09 * 28.0, 14.0 + 0.09 * 28.0))


def test_of_a_single_flight_the_figures_say_why_they_are_empty() -> None:
    results = made_search(searches=[part("all flights", (), 9.0, None, 0.15)], kept_aside={}, expected_gain=None)
    for figure in (shrinkage_figure(results), kept_aside_figure(results)):
        assert "nothing can be kept aside" in figure.axes[0].texts[0].get_text()


def test_parameters_on_a_ratio_axis_delays_on_their_own_with_what_each_part_found() -> None:
    figure = found_figure(made_search())
    ratios, delays = (axes for axes in figure.axes if axes.get_visible())
    assert names(ratios) == ["EKF2_GPS_V_NOISE", "EKF2_BARO_NOISE"], "what changes comes first"
    assert names(delays) == ["EKF2_GPS_DELAY"]
    marks = {line.get_label(): line.get_xdata()[0] for line in ratios.lines}
    # half of what flies now is one halving down
    assert marks["found on all flights"] == pytest.approx(-1.0)
    dots = [line.get_xdata()[0] for line in ratios.lines if str(line.get_label()).startswith("with a part")]
    assert sorted(dots)[:2] == pytest.approx([-1.3219, -1.0], abs=1e-4)  # log2(0.12 / 0.3), log2(0.15 / 0.3)
    assert title(figure) == "1 of 3 parameters would change"
