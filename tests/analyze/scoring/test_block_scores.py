"""Sums over blocks add up to the figures of the whole flight."""

from pathlib import Path

import numpy as np
import pyarrow as pa
from tests.analyze.made_flight import MadeSet, at, make_flight

from fusetune.analyze.replaying.store.reader import read_set
from fusetune.analyze.scoring.block_scores import block_rows, block_sums
from fusetune.analyze.scoring.measurement_alignment import axes_together, sample_masks
from fusetune.analyze.scoring.sample_scores import counted
from fusetune.analyze.scoring.window import ScoringWindow


def test_blocks_add_up_and_are_paired(tmp_path: Path) -> None:
    sets = {"present": MadeSet(), "other": MadeSet(error=0.2)}
    _, folder = make_flight(tmp_path, "flight", sets)
    window = ScoringWindow(((at(10.0), at(33.0)), (at(36.0), at(60.0))), (), {}, at(10.0))
    edges, tables, samples = window.block_edges(10.0), [], {}
    present = read_set(folder, "present")
    masks = sample_masks(present, window)
    for name in sets:
        sources = counted(read_set(folder, name), masks, window, 20.0)
        found = next(one for one in sources if ("gnss_vel", 0) in one)
        (velocity,) = axes_together(found.values())
        tables += block_rows("flight", {name: block_sums(velocity, edges)})
        samples[name] = velocity.samples[2]
    frame = pa.concat_tables(tables).to_pandas()
    frame = frame[frame["axis"] == 2]
    assert sorted(frame["block"].unique()) == [0, 1, 2, 3, 4]
    counts = frame.pivot(index="block", columns="set", values="n")
    np.testing.assert_array_equal(counts["present"], counts["other"])
    totals = frame.groupby("set")[["n", "sum_nis", "sum_log_variance", "sum_squared_innovation"]].sum()
    for name, one in samples.items():
        innovation, variance = one.innovation, one.innovation_variance
        nis = innovation**2 / variance
        assert totals.loc[name, "n"] == one.mask.time.size
        np.testing.assert_allclose(totals.loc[name, "sum_nis"], nis.sum())
        np.testing.assert_allclose(totals.loc[name, "sum_log_variance"], np.log(variance).sum())
        np.testing.assert_allclose(totals.loc[name, "sum_squared_innovation"], np.sum(innovation**2))
