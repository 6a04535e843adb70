"""Means of figures over flights, against means by hand."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.apply.mean_figures import MeanFigures, of_known

NAN = float("nan")


def test_means_are_over_the_flights_that_count_and_have_the_figure() -> None:
    figures = [
        ("one", "a", "rmse", 1.0),
        ("two", "a", "rmse", 4.0),
        ("two", "b", "rmse", 7.0),
        ("one", "b", "rmse", NAN),
        ("left out", "a", "rmse", 100.0),
        ("one", "not asked", "rmse", 5.0),
        ("one", "a", "nll", 3.0),
    ]
    rows = [
        {"flight": flight, "set": name, "source": "gnss_vel", "axis": "x", "metric": metric, "value": value}
        for flight, name, metric, value in figures
    ]
    table = pa.Table.from_pylist(rows, schema=METRICS_SCHEMA)
    for metrics in (table, table.set_column(1, "set", table["set"].dictionary_encode())):
        found = MeanFigures(metrics, ["one", "two"], ["c", "b", "a"], ["rmse"])
        np.testing.assert_array_equal(found.of("gnss_vel", "x", "rmse"), [NAN, 7.0, 2.5])
        assert np.isnan(found.of("gnss_vel", "x", "nll")).all()
        np.testing.assert_array_equal(found.by_axis(["gnss_vel"], "rmse")[:, 0], [NAN, 7.0, 2.5])
    assert np.isnan(MeanFigures(METRICS_SCHEMA.empty_table(), [], ["a"], ["rmse"]).of("gnss_vel", "x", "rmse")).all()


def test_what_is_not_known_does_not_count() -> None:
    figures = np.array([[1.0, NAN, 2.0], [NAN, NAN, 5.0], [NAN, NAN, NAN]])
    np.testing.assert_array_equal(of_known(figures, np.sum), [3.0, 5.0, NAN])
