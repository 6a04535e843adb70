"""The small curves, and the two aims of all trials."""

import numpy as np
from matplotlib.figure import Figure
from tests.apply.sensitivity.made_trials import drawn, made_trials

from fusetune.apply.sensitivity.sensitivity import sensitivity
from fusetune.report.figures.drawing import figure_style
from fusetune.report.figures.pareto_figure import pareto_figure
from fusetune.report.figures.sensitivity_figure import sensitivity_figure

SLOPES = (0.030, 0.035, 0.045, 0.032)
TRIALS = made_trials(drawn(40, 3), [lambda at, s=s: s * at[:, 0] ** 2 - 0.02 * at[:, 1] for s in SLOPES])


def texts(figure: Figure) -> str:
    return "\n".join(one.get_text() for one in figure.findobj(match=lambda artist: hasattr(artist, "get_text")))


def test_a_panel_for_each_told_parameter_those_that_matter_first() -> None:
    found = sensitivity(TRIALS, [0.3, 0.6, 0.3])
    with figure_style():
        figure = sensitivity_figure(found)
    panels = [axes for axes in figure.axes if axes.get_visible()]
    # from half the incumbent's value of the second to four times the present one, its errors change most
    assert [axes.get_title("left") for axes in panels] == ["EKF2_ACC_NOISE", "EKF2_GPS_V_NOISE", "EKF2_BARO_NOISE"]
    assert [axes.get_title(loc="right") for axes in panels] == ["matters", "matters", "flat"]
    assert figure.get_suptitle() == "What matters here: EKF2_ACC_NOISE and EKF2_GPS_V_NOISE"
    # the curve of the second: errors smaller by 100 (1 - exp(-0.02 c)) %, c doublings from 0.3
    curve = next(one for one in panels[0].lines if one.get_label() == "others as chosen")
    gain = np.interp(0.6, *curve.get_data())
    assert abs(gain - 100.0 * (1.0 - np.exp(-0.02))) < 0.2
    marks = {one.get_label(): one.get_xdata()[0] for one in panels[0].lines}
    assert (marks["flies now"], marks["chosen"]) == (0.3, 0.6)


def test_where_nothing_is_told_it_says_so() -> None:
    steps = np.array([-1.0, 0.5, 1.0])
    found = sensitivity(made_trials(np.column_stack([steps, steps]), [lambda at: 0.02 * at[:, 0]] * 2))
    with figure_style():
        assert "change them together" in texts(sensitivity_figure(found))
        assert "No set changes a parameter" in texts(sensitivity_figure(None))


def test_the_front_and_the_chosen_set_are_marked() -> None:
    with figure_style():
        figure = pareto_figure(TRIALS, "set3")
    (axes,) = figure.axes
    marks = {one.get_label(): one.get_xydata() for one in axes.lines}
    assert marks["flies now"].tolist() == [[0.0, 0.0]]
    gain = 100.0 * (1.0 - np.exp(TRIALS.differences[3].mean()))
    assert np.allclose(marks["chosen"], gain)
    # all aims are alike here, so the front is the best set alone
    best = 100.0 * (1.0 - np.exp(TRIALS.differences.mean(axis=1).min()))
    assert np.allclose(marks["Pareto front"][1], best)
    assert figure.get_suptitle().startswith(f"Two aims: a set has {best:.0f} % smaller errors with all sensors")


def test_trials_without_gaps_have_no_two_aims() -> None:
    unknown = np.full(TRIALS.differences.shape, np.nan)
    trials = type(TRIALS)(
        TRIALS.factors, TRIALS.names, TRIALS.values, TRIALS.flights, TRIALS.differences,
        dict(TRIALS.aims) | {"unaided": unknown}, TRIALS.allowed,
    )  # fmt: skip
    with figure_style():
        assert "No flights tell about both" in texts(pareto_figure(trials))
