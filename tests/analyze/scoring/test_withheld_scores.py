"""Predictions in gaps, paired between sets and summed up; expectations by hand."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from fusetune.analyze.flight.intervals import Cut
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.analyze.scoring.charges import EvidenceCost
from fusetune.analyze.scoring.metrics_table import MetricsTable
from fusetune.analyze.scoring.true_errors import Truth
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.analyze.scoring.withheld_scores import (
    CountedGaps,
    add_true_drift,
    add_withheld_metrics,
    counted_gaps,
    gap_masks,
    own_gaps,
    withheld_rows,
)

SECOND = 1_000_000
WINDOW = ScoringWindow(((0, 100 * SECOND),), (), {}, 0)


def record(name: str, withheld: dict[str, np.ndarray], fused_until_s: int = 200) -> ReplayedSet:
    """A set that fuses GNSS velocity once a second, up to some time, with what it predicted in gaps."""
    time = np.arange(200) * SECOND
    ones = np.ones(time.size)
    fused = time < fused_until_s * SECOND
    samples = AxisSamples(time, ones, ones, ones, ones, ~fused, fused)
    return ReplayedSet(name, {}, {}, {}, {("gnss_vel", 0): samples}, {}, {}, withheld=lambda: withheld)


def predicted(starts_s: list[int], errors: list[float], variance: float = 1.0) -> dict[str, np.ndarray]:
    """Predictions of GNSS velocity north at the end of gaps of 9 s."""
    count = len(starts_s)
    start = np.array(starts_s, np.int64) * SECOND
    return {
        "sensor": np.array(["gnss"] * count),
        "source": np.array(["gnss_vel"] * count),
        "gap": np.arange(count, dtype=np.int32),
        "start": start,
        "stop": start + 9 * SECOND,
        "axis": np.zeros(count, np.int32),
        "horizon_s": np.full(count, 9.0),
        "n": np.full(count, 5, np.int32),
        "innovation": np.array(errors),
        "innovation_variance": np.full(count, variance),
    }


def counted(now: ReplayedSet, other: ReplayedSet, most_lacking: float = 20.0, **window: Any) -> list[CountedGaps]:
    """Predictions of another set in the gaps of the present one."""
    masks = gap_masks(now, WINDOW)
    return counted_gaps(masks, other, dataclasses.replace(WINDOW, **window), most_lacking)


def test_the_gaps_are_those_of_the_present_set_that_lie_in_the_window() -> None:
    now = record("present", predicted([10, 20, 30, 95], [1.0, -2.0, 3.0, 4.0]))
    late = record("late", predicted([20, 30, 40, 95], [5.0, 6.0, 0.1, 7.0]))
    (mask,) = gap_masks(now, WINDOW)
    # The gap at 95 s reaches beyond the window; that at 40 s the present set does not have.
    np.testing.assert_array_equal(mask.start, np.array([10, 20, 30]) * SECOND)
    np.testing.assert_allclose(mask.error, [1.0, -2.0, 3.0])
    # 5 robust standard deviations of the present set's errors, of median 2
    assert mask.winsor_limit == pytest.approx(5 * 1.4826 * 2.0)
    (found,) = counted(now, late, 50.0)
    # The other set lacks that at 10 s.
    np.testing.assert_allclose(found.error, [5 * 1.4826 * 2.0, 5.0, 6.0])
    assert found.cost == EvidenceCost(mask=3, lacking=1, after_reset=0)
    (own,) = own_gaps([mask])
    np.testing.assert_array_equal(own.error, mask.error)


def test_a_set_that_lacks_too_much_is_left_out() -> None:
    now = record("present", predicted([10, 20, 30], [1.0, 2.0, 3.0]))
    (found,) = counted(now, record("late", predicted([30], [9.0])))
    assert not found.is_compared
    assert found.cost.lacking_percent == pytest.approx(200 / 3)
    (found,) = counted(now, record("good", predicted([10, 20, 30], [0.5, 1.0, 1.5])))
    np.testing.assert_array_equal(found.error, [0.5, 1.0, 1.5])


@pytest.mark.parametrize("broken", [{"innovation": np.nan}, {"innovation_variance": 0.0}])
def test_a_prediction_that_is_no_number_is_lacking(broken: dict[str, float]) -> None:
    now = record("present", predicted([10, 20, 30, 40], [1.0, 1.0, 1.0, 1.0]))
    other = predicted([10, 20, 30, 40], [0.1, 0.1, 0.1, 0.1])
    for name, value in broken.items():
        other[name][1] = value
    (found,) = counted(now, record("other", other), 50.0)
    np.testing.assert_allclose(found.error, [0.1, 5 * 1.4826, 0.1, 0.1])
    np.testing.assert_allclose(found.variance, 1.0)


def test_a_horizon_without_a_measurement_before_it_says_nothing() -> None:
    """Of the gap at 20 s the other set predicted after 3 s, and no measurement came in the second before 9 s."""
    long = predicted([10, 20, 30], [1.0, 2.0, 1.0])
    short = predicted([10, 20, 30], [0.1, 0.1, 0.1]) | {"horizon_s": np.full(3, 3.0)}
    both = {name: np.concatenate([long[name], short[name]]) for name in long}
    without = {name: np.delete(values, 1) for name, values in both.items()}
    without["innovation"] = np.array([0.5, 0.5, 0.1, 0.1, 0.1])
    (_, after_9_s) = counted(record("present", both), record("other", without), 50.0)
    np.testing.assert_allclose(after_9_s.error, [0.5, 2.0, 0.5])


def test_a_gap_after_a_reset_of_its_own_counts_no_better_than_the_present_set() -> None:
    around = {"own_resets": {"other": (Cut(18 * SECOND, 22 * SECOND, "reset"),)}}
    now = record("present", predicted([10, 20, 30], [1.0, -2.0, 3.0]))
    other = record("other", predicted([10, 20, 30], [0.1, 0.2, 0.3]))
    (found,) = counted(now, other, **around)
    np.testing.assert_allclose(found.error, [0.1, -2.0, 0.3])
    early = {"own_resets": {"other": (Cut(3 * SECOND, 6 * SECOND, "reset"),)}}
    (found,) = counted(now, other, **early)
    np.testing.assert_allclose(found.error, [0.1, 0.2, 0.3])
    # What it does worse than the present set stays its own.
    other = record("other", predicted([10, 20, 30], [0.1, 4.0, 0.3]))
    (found,) = counted(now, other, **around)
    np.testing.assert_allclose(found.error, [0.1, 4.0, 0.3])


def test_a_gap_counts_only_while_the_present_set_uses_the_sensor() -> None:
    now = record("present", predicted([10, 20, 30], [1.0, 2.0, 3.0]), fused_until_s=21)
    (mask,) = gap_masks(now, WINDOW)
    np.testing.assert_array_equal(mask.start, [10 * SECOND, 20 * SECOND])


def test_figures_by_hand() -> None:
    now = record("present", predicted([10, 20, 30, 40], [3.0, -3.0, 3.0, -3.0], variance=9.0))
    other = record("other", predicted([10, 20, 30, 40], [1.0, 1.0, 1.0, 1.0], variance=1.0))
    table = MetricsTable("made")
    add_withheld_metrics(table, "present", own_gaps(gap_masks(now, WINDOW)))
    add_withheld_metrics(table, "other", counted(now, other))
    rows = {(row["set"], row["metric"]): row["value"] for row in table.finished().to_pylist()}
    assert rows["present", "withheld_rms_9s"] == pytest.approx(3.0)
    assert rows["other", "withheld_rms_9s"] == pytest.approx(1.0)
    # ½ (ν²/S + ln S + ln 2π) with ν²/S = 1 in both
    assert rows["present", "withheld_nll_9s"] == pytest.approx(0.5 * (1 + np.log(9.0) + np.log(2 * np.pi)))
    assert rows["other", "withheld_nll_9s"] == pytest.approx(0.5 * (1 + np.log(2 * np.pi)))


def test_outliers_are_winsorised_at_the_present_sets_limit() -> None:
    now = record("present", predicted(list(range(0, 80, 5)), [1.0] * 15 + [100.0]))
    other = record("other", predicted(list(range(0, 80, 5)), [2.0] * 15 + [50.0]))
    edges = np.array([0, 40, 80]) * SECOND
    sets = {"present": own_gaps(gap_masks(now, WINDOW)), "other": counted(now, other)}
    rows, beside = (table.to_pandas() for table in withheld_rows("made", sets, edges))
    # 5 robust standard deviations: 5 · 1.4826 · the median 1.0
    assert rows["error_winsorised"].max() == pytest.approx(5 * 1.4826)
    assert rows["error"].max() == 100.0
    assert rows.groupby("block")["start_us"].nunique().tolist() == [8, 8]
    assert (set(rows["set"]), set(beside["set"])) == ({"present"}, {"other"})
    assert beside["error_winsorised"].max() == pytest.approx(5 * 1.4826)


def test_growth_of_the_true_error_over_a_gap() -> None:
    starts = np.array([10, 20, 30], np.int64) * SECOND
    columns = {"sensor": np.array(["gnss"] * 3), "start": starts, "stop": starts + 9 * SECOND}
    for moment, time, offset in (("begin", starts, 0.5), ("end", starts + 9 * SECOND, 3.5)):
        columns |= {f"timestamp_{moment}": time, f"x_{moment}": 2.0 * time * 1e-6 + offset}
        columns |= {f"{name}_{moment}": np.zeros(3) for name in ("y", "z", "vy", "vz")} | {
            f"vx_{moment}": np.full(3, 2.0)
        }
    time = np.arange(101, dtype=np.int64) * SECOND
    course = np.column_stack([2.0 * time * 1e-6, 0.0 * time, 0.0 * time])
    speed = np.column_stack([np.full(time.size, 2.0), 0.0 * time, 0.0 * time])
    truth = Truth(time, course, speed, time[:0], np.zeros((0, 4)), None)
    table = MetricsTable("made")
    now = dataclasses.replace(record("present", {}), gaps=lambda: columns)
    add_true_drift(table, now, truth, WINDOW)
    rows = {row["source"]: row["value"] for row in table.finished().to_pylist()}
    assert rows["truth_withheld_position"] == pytest.approx(3.0)
    assert rows["truth_withheld_velocity"] == pytest.approx(0.0, abs=1e-9)
