"""Test ratios of sets where they are scored."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from fusetune.analyze.scoring.sample_scores import SAMPLES_SCHEMA
from fusetune.report.figures.flight_ratios import scored_ratios
from fusetune.storage.parquet import write_table


def test_the_largest_of_the_axes_with_a_gap_between_scored_parts(tmp_path: Path) -> None:
    ratios = {
        ("b", "gnss_vel", 0): {10: 0.5, 20: 0.1, 50: 0.2},
        ("b", "gnss_vel", 2): {10: 0.3, 20: 4.0, 50: 1e-9},
        ("other", "gnss_vel", 0): {10: 7.0},
    }
    rows = [
        {"set": name, "source": source, "axis": axis, "time_us": time, "test_ratio": ratio}
        for (name, source, axis), of_axis in ratios.items()
        for time, ratio in of_axis.items()
    ]
    write_table(pa.Table.from_pylist(rows, schema=SAMPLES_SCHEMA), tmp_path / "samples.parquet", row_group_size=2)
    found = scored_ratios(tmp_path / "samples.parquet", ["b", "c"], [(5, 25), (40, 60)])
    assert (list(found), list(found["b"]), found["c"]) == (["b", "c"], ["gnss_vel"], {})
    times, largest = found["b"]["gnss_vel"]
    assert largest[[0, 1, 3]] == pytest.approx([0.5, 4.0, 0.2])
    assert np.isnan(largest[2])
    assert times[[0, 1, 3]].tolist() == [10, 20, 50]
