"""Sums over blocks add up to the figures of the whole flight."""

from pathlib import Path

import numpy as np
from tests.analyze.made_flight import MadeSet, at, make_flight

from fusetune.analyze.replaying.store.reader import read_set
from fusetune.analyze.scoring.block_scores import block_rows
from fusetune.analyze.scoring.measurement_alignment import paired_samples
from fusetune.analyze.scoring.window import ScoringWindow


def test_blocks_add_up_and_are_paired(tmp_path: Path) -> None:
    sets = {"present": MadeSet(), "other": MadeSet(error=0.2)}
    _, folder = make_flight(tmp_path, "flight", sets)
    window = ScoringWindow(((at(10.0), at(33.0)), (at(36.0), at(60.0))), (), {}, at(10.0))
    pairs = paired_samples([read_set(folder, name) for name in sets], ("gnss_vel", 2), "present", window)
    assert pairs is not None
    frame = block_rows("flight", pairs, window.block_edges(10.0)).to_pandas()
    assert sorted(frame["block"].unique()) == [0, 1, 2, 3, 4]
    counts = frame.pivot(index="block", columns="set", values="n")
    np.testing.assert_array_equal(counts["present"], counts["other"])
    totals = frame.groupby("set")[["n", "sum_nis", "sum_log_variance", "sum_squared_innovation"]].sum()
    for name, one in zip(pairs.sets, pairs.each(), strict=True):
        innovation, variance = one.innovation[0], one.innovation_variance[0]
        nis = innovation**2 / variance
        assert totals.loc[name, "n"] == pairs.time.size
        np.testing.assert_allclose(totals.loc[name, "sum_nis"], nis.sum())
        np.testing.assert_allclose(totals.loc[name, "sum_log_variance"], np.log(variance).sum())
        np.testing.assert_allclose(totals.loc[name, "sum_squared_innovation"], np.sum(innovation**2))
