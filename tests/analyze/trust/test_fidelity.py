"""Fidelity figures on hand-made replays, and of a reference against itself."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fusetune.analyze.trust.fidelity import compare_folders, compare_set, order_agreement
from fusetune.errors import UserError

N = 40
TIMES = 1_000_000 + 200_000 * np.arange(N)


def write_replay(folder, *, innovation=0.1, variance=0.04, rejected=0, turn_deg=0.0, flag_from=None, resets=1):
    folder.mkdir(exist_ok=True)
    table = {
        "source": np.repeat("gnss_vel", N), "axis": np.zeros(N, np.int32), "timestamp_sample": TIMES,
        "observation": np.zeros(N, np.float32), "observation_variance": np.ones(N, np.float32),
        "innovation": np.full(N, innovation, np.float32), "innovation_variance": np.full(N, variance, np.float32),
        "innovation_rejected": np.arange(N) < rejected, "fused": np.arange(N) >= rejected,
    }  # fmt: skip
    pq.write_table(pa.table(table), folder / "present.innovations.parquet")
    half = np.deg2rad(turn_deg) / 2
    states = {f"states_{i}": np.zeros(N, np.float32) for i in range(25)}
    states["states_0"], states["states_3"] = np.full(N, np.cos(half)), np.full(N, np.sin(half))
    pq.write_table(pa.table({"timestamp_sample": TIMES} | states), folder / "present.states.parquet")
    rows = np.array([TIMES[0], TIMES[N // 2], TIMES[-1]])
    raised = rows >= flag_from if flag_from else np.zeros(3, bool)
    pq.write_table(pa.table({"timestamp": rows, "cs_in_air": raised}), folder / "present.status_flags.parquet")
    (folder / "present.json").write_text(json.dumps({"resets": {"xy_reset_counter": resets}}))


def test_equal_replays_have_no_difference(tmp_path):
    write_replay(tmp_path / "a")
    write_replay(tmp_path / "b")
    result = compare_set(tmp_path / "a", tmp_path / "b", "present")
    assert result.median_relative_rms == 0
    assert result.flags_equal == 1
    assert result.resets_equal
    assert result.attitude_rms_deg == pytest.approx(0, abs=1e-5)
    assert result.missing == 0


def test_each_figure_is_what_a_known_change_makes_it(tmp_path):
    write_replay(tmp_path / "a")
    write_replay(tmp_path / "b", innovation=0.11, variance=0.05, turn_deg=2.0, flag_from=TIMES[N // 2], resets=2)
    result = compare_set(tmp_path / "a", tmp_path / "b", "present")
    (axis,) = result.axes
    assert axis.relative_rms == pytest.approx(0.1, rel=1e-5)
    assert axis.variance_difference == pytest.approx(0.25, rel=1e-5)
    nll = [0.5 * (v**2 / s + np.log(2 * np.pi * s)) for v, s in ((0.1, 0.04), (0.11, 0.05))]
    assert axis.nll_difference == pytest.approx(abs(nll[1] - nll[0]), rel=1e-4)
    assert result.attitude_rms_deg == pytest.approx(2.0, rel=1e-3)
    assert result.flags_equal == pytest.approx((N // 2) / (N - 1), rel=1e-6)
    assert result.differing_flags == ("cs_in_air",)
    assert not result.resets_equal


def test_rows_before_the_first_fused_gnss_sample_do_not_count(tmp_path):
    write_replay(tmp_path / "a", rejected=10)
    write_replay(tmp_path / "b", rejected=12)
    (axis,) = compare_set(tmp_path / "a", tmp_path / "b", "present").axes
    assert axis.samples == N - 10
    assert axis.fused_equal == pytest.approx(1 - 2 / (N - 10))


def test_folder_without_the_sets_is_a_clear_error(tmp_path):
    write_replay(tmp_path / "a")
    (tmp_path / "b").mkdir()
    with pytest.raises(UserError, match="present"):
        compare_folders(tmp_path / "a", tmp_path / "b")


def test_reference_agrees_with_itself(golden_reference):
    for folder in golden_reference.iterdir():
        assert_agrees_with_itself(compare_folders(folder, folder))


def test_order_of_the_sets_agrees_with_itself(shared_reference):
    folder = shared_reference / "erdemarslan380__sitl_max_80"
    results = compare_folders(folder, folder)
    assert_agrees_with_itself(results)
    assert len(results) == 8
    assert order_agreement(results) == pytest.approx(1)


def assert_agrees_with_itself(results):
    assert all(r.axes and r.median_relative_rms == 0 and r.missing == 0 and r.flags_equal == 1 for r in results)
