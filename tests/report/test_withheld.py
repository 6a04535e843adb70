"""Drift without a sensor, from figures by hand."""

import numpy as np
import pandas as pd
import pytest

from fusetune.apply.ranking import ELIGIBLE, NOT_ELIGIBLE, PRESENT
from fusetune.report.figures.drawing import figure_style
from fusetune.report.figures.unaided_figures import drift_figure
from fusetune.report.results import Results
from fusetune.report.sections.evidence_sections import _shorter_gaps
from fusetune.report.withheld import (
    BAROMETER,
    MAGNETOMETER,
    POSITION,
    VELOCITY,
    drift,
    drift_summary,
    usual_gap_length,
)


def results(rows: list[tuple], shown: tuple[str, ...] = ("present", "b"), vetoed: tuple[str, ...] = ()) -> Results:
    metrics = pd.DataFrame(rows, columns=["flight", "set", "source", "axis", "metric", "value"])
    names = ["flight", "set", "source", "axis", "metric"]
    ranking = pd.DataFrame({"name": list(shown)})
    ranking["status"] = [PRESENT if n == "present" else NOT_ELIGIBLE if n in vetoed else ELIGIBLE for n in shown]
    return Results(
        decision={"chosen": "present"},
        ranking=ranking,
        per_flight=pd.DataFrame(),
        metrics=metrics.astype(dict.fromkeys(names, "category")),
        scoring={},
        folders={},
        shown=shown,
        present="present",
    )


def position(flight: str, name: str, x: float, y: float, horizon: str = "9") -> list[tuple]:
    return [
        (flight, name, "gnss_pos", "x", f"withheld_rms_{horizon}s", x),
        (flight, name, "gnss_pos", "y", f"withheld_rms_{horizon}s", y),
    ]


def test_axes_are_joined_to_a_norm_per_flight_set_and_horizon() -> None:
    found = drift(results([*position("f", "present", 3.0, 4.0), *position("f", "present", 0.3, 0.4, "4.5")]), POSITION)
    assert dict(zip(found["horizon_s"], found["drift"], strict=True)) == pytest.approx({9.0: 5.0, 4.5: 0.5})


def test_a_flight_with_an_axis_missing_does_not_count() -> None:
    rows = [*position("f", "present", 3.0, 4.0), ("g", "present", "gnss_pos", "x", "withheld_rms_9s", 1.0)]
    assert list(drift(results(rows), POSITION)["flight"]) == ["f"]


def test_other_metrics_and_sets_that_are_not_shown_do_not_count() -> None:
    rows = [
        *position("f", "hidden", 3.0, 4.0),
        ("f", "present", "gnss_pos", "x", "withheld_nll_9s", 1.0),
        ("f", "present", "gnss_pos", "x", "rms_innovation", 1.0),
    ]
    assert drift(results(rows), POSITION).empty
    assert drift_summary(results(rows), POSITION).empty


def test_the_magnetometer_has_three_axes_and_the_barometer_one() -> None:
    rows = [
        ("f", "present", "mag", axis, "withheld_rms_9s", value) for axis, value in zip("xyz", (1, 2, 2), strict=True)
    ]
    rows.append(("f", "present", "baro_hgt", "x", "withheld_rms_9s", 0.7))
    made = results(rows)
    assert drift(made, MAGNETOMETER)["drift"].to_list() == pytest.approx([3.0])
    assert drift(made, BAROMETER)["drift"].to_list() == pytest.approx([0.7])


def test_the_change_is_paired_by_flight_and_a_mean_of_logarithms() -> None:
    rows = []
    # On one flight twice the drift, on another half of it: no change on average, though the mean drift differs.
    for flight, now, other in (("f", 1.0, 2.0), ("g", 8.0, 4.0)):
        rows += position(flight, "present", now, 0.0) + position(flight, "b", other, 0.0)
    summary = drift_summary(results(rows), POSITION)
    assert summary["mean"].loc["present", 9.0] == pytest.approx(4.5)
    assert summary["mean"].loc["b", 9.0] == pytest.approx(3.0)
    assert summary["change"].loc["b", 9.0] == pytest.approx(0.0, abs=1e-9)
    assert summary["flights"].loc["b", 9.0] == 2
    # Standard error of (ln 2, -ln 2): sd √2 ln 2, divided by √2.
    assert summary["change_high"].loc["b", 9.0] == pytest.approx(100.0)
    assert summary["change_low"].loc["b", 9.0] == pytest.approx(-50.0)


def test_flights_with_gaps_of_another_length_are_not_averaged_with_the_others() -> None:
    """Three flights with gaps of 9 s, a short one with gaps of 3 s: its drift after 3 s is of the end of a gap."""
    rows = []
    for flight in ("f", "g", "h"):
        rows += position(flight, "present", 3.0, 4.0) + position(flight, "present", 0.3, 0.4, "3")
    rows += position("short", "present", 30.0, 40.0, "3") + position("short", "present", 3.0, 4.0, "1")
    summary = drift_summary(results(rows), POSITION)
    assert summary["mean"].to_dict() == pytest.approx({("present", 3.0): 0.5, ("present", 9.0): 5.0})
    assert set(summary["flights"]) == {3}
    (note,) = _shorter_gaps(results(rows))
    assert "Drawn are gaps of 9 s." in note
    assert "short 3 s" in note
    assert _shorter_gaps(results(position("f", "present", 3.0, 4.0))) == []


def test_of_as_many_flights_those_with_the_longer_gaps_are_drawn() -> None:
    lengths = pd.Series({"f": 9.0, "g": 3.0})
    assert usual_gap_length(lengths) == 9.0


def test_the_figure_shows_each_set_at_each_horizon_and_lets_a_hopeless_one_leave() -> None:
    rows = []
    for flight, size in (("f", 1.0), ("g", 1.2)):
        for name, factor in (("present", 1.0), ("b", 0.8), ("hopeless", 500.0)):
            for horizon in ("3", "6", "9"):
                rows += position(flight, name, size * factor * float(horizon), 0.0, horizon)
    made = results(rows, ("present", "b", "hopeless"), vetoed=("hopeless",))
    with figure_style():
        figure = drift_figure(made)
    above, below = figure.axes
    curves = {line.get_label(): np.asarray(line.get_ydata(), float) for line in above.lines}
    np.testing.assert_allclose(curves["present (flies now)"], 1.1 * np.array([3.0, 6.0, 9.0]))
    np.testing.assert_allclose(curves["b"], 0.88 * np.array([3.0, 6.0, 9.0]))
    assert "hopeless (not eligible)" in curves
    assert above.get_ylim()[1] < 15.0
    assert below.get_ylim()[1] < 1000.0
    assert [tick.get_text() for tick in above.get_xticklabels()] == ["3", "6", "9"]


def test_a_figure_without_gaps_says_so() -> None:
    (axes,) = drift_figure(results([("f", "present", "gnss_vel", "x", "rms_innovation", 1.0)])).axes
    assert "not withheld" in axes.texts[0].get_text()
    assert drift_summary(results([]), VELOCITY).empty
