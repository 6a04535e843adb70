"""Windows of a flight: their edges, their figures, and the worst of them."""

import numpy as np
import pytest

from fusetune.analyze.metrics.likelihood import gaussian_nll
from fusetune.analyze.scoring.measurement_alignment import AxesTogether, CountedSamples, SampleMask
from fusetune.analyze.scoring.metrics_table import MetricsTable
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.analyze.scoring.window_scores import add_worst_windows, window_edges, window_figures, window_rows

SECOND = 1_000_000


def samples(*innovations: list[float]) -> AxesTogether:
    """Innovations of GNSS velocity, an axis each, once a second, that claim a variance of 1."""
    time = np.arange(len(innovations[0]), dtype=np.int64) * SECOND
    return AxesTogether("gnss_vel", tuple(_of_axis(axis, np.array(one), time) for axis, one in enumerate(innovations)))


def _of_axis(axis: int, innovation: np.ndarray, time: np.ndarray) -> CountedSamples:
    mask = SampleMask("gnss_vel", axis, time, 0.0, np.arange(time.size, dtype=np.int32), innovation)
    square = np.square(innovation)
    return CountedSamples(mask, innovation, np.ones(time.size), square / 25.0, square > 25.0)


@pytest.mark.parametrize(
    ("length_s", "edges_s"),
    [(60, [0, 30, 60]), (74, [0, 30, 74]), (75, [0, 30, 60, 75]), (76, [0, 30, 60, 76]), (10, [0, 10])],
)
def test_a_rest_shorter_than_half_a_window_joins_its_neighbour(length_s: int, edges_s: list[int]) -> None:
    window = ScoringWindow(((5 * SECOND, (5 + length_s) * SECOND),), (), {}, 0)
    assert (window_edges(window, 30.0) / SECOND - 5).tolist() == edges_s


def test_figures_of_windows_by_hand() -> None:
    given = samples([1.0, -1.0, 3.0, 4.0], [0.0, 0.0, 6.0, 0.0])
    figures = next(window_figures(given, np.array([0, 2, 4]) * SECOND))
    assert figures.axes == ("x", "y")
    np.testing.assert_allclose(figures.values["rms_innovation"], [[1.0, np.sqrt(12.5)], [0.0, np.sqrt(18.0)]])
    np.testing.assert_allclose(figures.values["mean_nis"], [[1.0, 12.5], [0.0, 18.0]])
    np.testing.assert_allclose(figures.values["break_rate_3sd"], [[0.0, 0.5], [0.0, 0.5]])
    np.testing.assert_allclose(figures.values["break_rate_5sd"], [[0.0, 0.0], [0.0, 0.5]])
    np.testing.assert_allclose(figures.values["break_rate_gate"], [[0.0, 0.0], [0.0, 0.5]])
    assert figures.parts.counts.tolist() == [2, 2]


def test_the_likelihood_is_winsorised_by_the_spread_of_the_whole_flight() -> None:
    # median |ν| is 1, so the limit is 5 · 1.4826
    figures = next(window_figures(samples([1.0, -1.0, 1.0, 100.0]), np.array([0, 2, 4]) * SECOND))
    limit, one = 5.0 * 1.4826, np.ones(1)
    expected = 0.5 * (gaussian_nll(one, one) + gaussian_nll(limit * one, one))
    np.testing.assert_allclose(figures.values["nll_winsorised"][0, 1], expected[0])


def test_axes_together_add_up_and_break_when_any_does() -> None:
    given = samples([3.0, 0.0, 0.0, 0.0], [4.0, 6.0, 0.0, 0.0])
    figures = {one.axes: one for one in window_figures(given, np.array([0, 2, 4]) * SECOND)}["horizontal",]
    assert figures.values["rms_innovation"][0, 0] == pytest.approx(np.sqrt((25.0 + 36.0) / 2.0))
    assert figures.values["mean_nis"][0, 0] == pytest.approx((25.0 + 36.0) / 2.0)
    assert figures.values["break_rate_5sd"][0, 0] == 0.5


def test_too_few_samples_have_no_windows() -> None:
    assert list(window_figures(samples([3.0, 0.0, 1.0]), np.array([0, 2]) * SECOND)) == []


def test_the_worst_window_is_no_nearly_empty_one() -> None:
    given = samples([1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 100.0])
    edges = np.array([0, 4, 8, 12]) * SECOND
    table = MetricsTable("f")
    add_worst_windows({"a": table}, next(window_figures(given, edges)))
    rows = {row["metric"]: row["value"] for row in table.finished().to_pylist()}
    assert rows["worst_window_rms"] == 2.0
    assert rows["worst_window_nis"] == 4.0
    assert rows["worst_window_break_rate_3sd"] == 0.0


def test_rows_name_window_edges_and_samples() -> None:
    edges = np.array([0, 2, 4]) * SECOND
    figures = list(window_figures(samples([1.0, -1.0, 3.0, 4.0], [0.0, 0.0, 6.0, 0.0]), edges))
    (table,) = (rows.to_pylist() for rows in window_rows("f", {"b": figures}, edges))
    # two axes, and the group of both
    assert len(table) == 3 * 2 * 6
    row = next(one for one in table if (one["axis"], one["window"], one["metric"]) == ("y", 1, "rms_innovation"))
    assert row["value"] == pytest.approx(np.sqrt(18.0))
    assert (row["set"], row["start_us"], row["stop_us"], row["n"]) == ("b", 2 * SECOND, 4 * SECOND, 2)
