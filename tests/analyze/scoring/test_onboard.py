"""The vehicle's own innovations reach the layout of a replay, of the primary estimator instance."""

from pathlib import Path

import numpy as np
import pandas as pd

from fusetune.analyze.replaying.onboard import onboard_samples, write_onboard
from fusetune.analyze.replaying.store.reader import read_innovations
from fusetune.px4.flight import Flight


def flight() -> Flight:
    time = np.array([1_000_000, 1_200_000, 1_200_000, 1_400_000], dtype=np.int64)
    topics = {}
    for instance in (0, 1):
        base = {"timestamp": time + 5000, "timestamp_sample": time, "fused": np.array([False, True, True, True])}
        base["innovation_rejected"] = np.zeros(4, bool)
        vector = {
            f"{name}[{axis}]": np.full(4, 0.1 * (axis + 1) + instance)
            for name in ("innovation", "innovation_variance", "test_ratio")
            for axis in range(3)
        }
        topics["estimator_aid_src_gnss_vel", instance] = base | vector
        topics["estimator_aid_src_baro_hgt", instance] = base | {
            "innovation": np.full(4, -0.5),
            "innovation_variance": np.full(4, 2.0),
            "test_ratio": np.full(4, 0.01),
        }
    topics["estimator_selector_status", 0] = {
        "timestamp": time,
        "primary_instance": np.array([0, 1, 1, 1], dtype=np.uint8),
    }
    return Flight("flight", topics)


def test_the_instance_that_is_primary_at_the_time_counts_and_repeated_rows_count_once() -> None:
    samples = onboard_samples(flight())
    assert set(samples) == {("gnss_vel", 0), ("gnss_vel", 1), ("gnss_vel", 2), ("baro_hgt", 0)}
    np.testing.assert_allclose(samples["gnss_vel", 1].innovation, [0.2, 1.2, 1.2])
    np.testing.assert_array_equal(samples["baro_hgt", 0].timestamp_sample, [1_000_000, 1_200_000, 1_400_000])


def test_what_is_written_is_what_a_replay_would_write(tmp_path: Path) -> None:
    samples = onboard_samples(flight())
    write_onboard(tmp_path / "onboard.innovations.parquet", samples)
    back = read_innovations(tmp_path / "onboard.innovations.parquet", {})
    assert set(back) == set(samples)
    np.testing.assert_array_equal(back["gnss_vel", 2].innovation, samples["gnss_vel", 2].innovation)
    np.testing.assert_array_equal(back["baro_hgt", 0].fused, [False, True, True])


def test_a_log_without_innovations_gives_an_empty_table(tmp_path: Path) -> None:
    write_onboard(tmp_path / "none.parquet", onboard_samples(Flight("flight")))
    frame = pd.read_parquet(tmp_path / "none.parquet")
    assert len(frame) == 0
    assert {"source", "axis", "timestamp_sample", "innovation", "innovation_variance"} <= set(frame.columns)
    assert read_innovations(tmp_path / "none.parquet", {}) == {}
