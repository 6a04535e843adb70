"""The window follows from the present set: cuts and warm-up by hand, intervals by their invariants."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.analyze.made_flight import LANDING_S, MadeSet, at, make_flight

from fusetune.analyze.flight.intervals import Cut, subtract
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.store.reader import read_set
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.window import FUSION_DELAY_US, end_of_warm_up, scoring_window

AIRBORNE = ((at(10.0), at(LANDING_S)),)
SETTINGS = ScoringSettings()


def records(root: Path, sets: dict[str, MadeSet]) -> list[ReplayedSet]:
    _, folder = make_flight(root, "flight", sets)
    return [read_set(folder, name) for name in sets]


@given(st.lists(st.tuples(st.integers(-50, 150), st.integers(0, 60)), max_size=8))
def test_subtracting_leaves_what_no_cut_covers(spans: list[tuple[int, int]]) -> None:
    cuts = [Cut(start, start + length, "cut") for start, length in spans]
    remaining = subtract([(0, 100)], cuts)
    inside = {t for start, stop in remaining for t in range(start, stop)}
    assert inside == {t for t in range(100) if not any(cut.start <= t < cut.stop for cut in cuts)}
    assert all(a[1] <= b[0] for a, b in pairwise(remaining))


def test_ground_and_warm_up_are_not_scored(tmp_path: Path) -> None:
    made = records(tmp_path, {"present": MadeSet(aiding_s=12.0)})
    window = scoring_window(made[0], AIRBORNE, (), SETTINGS)
    # aiding at 12 s, less the GNSS delay of 110 ms, and 5 s to settle
    assert window.intervals == ((at(12.0 + 5.0 - 0.11), at(LANDING_S)),)


def test_a_set_that_starts_later_does_not_move_the_warm_up(tmp_path: Path) -> None:
    made = records(tmp_path, {"present": MadeSet(aiding_s=12.0), "late": MadeSet(aiding_s=40.0)})
    window = scoring_window(made[0], AIRBORNE, (), SETTINGS).of_set(made[1], SETTINGS)
    assert window.excluded == {}
    assert window.warm_up_end == at(12.0 + 5.0 - 0.11)
    # Its own warm-up ends later; a set that starts earlier settles with the present one.
    assert end_of_warm_up(made[1], made[0], SETTINGS) == at(40.0 + 5.0 - 0.11)
    assert end_of_warm_up(made[0], made[1], SETTINGS) == at(40.0 + 5.0 - 0.11)


def test_a_reset_of_the_present_set_is_cut(tmp_path: Path) -> None:
    made = records(tmp_path, {"present": MadeSet(resets_s=(40.0,)), "other": MadeSet()})
    window = scoring_window(made[0], AIRBORNE, (), SETTINGS)
    assert window.intervals == ((at(10.0), at(40.0) - FUSION_DELAY_US), (at(43.0), at(LANDING_S)))
    assert [cut.reason for cut in window.cuts] == ["reset of horizontal position"]
    finding = window.cuts[0].finding
    assert (finding.severity, finding.found) == ("note", "reset of horizontal position")
    assert (finding.start_us, finding.stop_us, finding.figure) == (at(40.0) - FUSION_DELAY_US, at(43.0), 3.5)


def test_a_reset_of_another_set_is_its_own_affair(tmp_path: Path) -> None:
    """3.5 s around each of two resets, of which the second overlaps the first by 1.5 s, and the landing none."""
    made = records(tmp_path, {"present": MadeSet(), "other": MadeSet(resets_s=(40.0, 42.0))})
    window = scoring_window(made[0], AIRBORNE, (), SETTINGS).of_set(made[1], SETTINGS)
    assert (window.intervals, window.cuts) == (AIRBORNE, ())
    assert window.own_resets_s("other") == pytest.approx(5.5)
    assert window.own_resets_s("present") == 0.0
    times = np.array([at(39.4), at(39.5), at(44.9), at(45.0)])
    assert window.after_own_reset("other", times).tolist() == [False, True, True, False]
    assert not window.after_own_reset("present", times).any()


def test_a_gap_in_the_log_is_cut_with_the_time_after_it(tmp_path: Path) -> None:
    made = records(tmp_path, {"present": MadeSet()})
    window = scoring_window(made[0], AIRBORNE, ((at(30.0), at(31.0)),), SETTINGS)
    assert window.intervals == ((at(10.0), at(30.0)), (at(34.0), at(LANDING_S)))


@settings(max_examples=20, deadline=None)
@given(resets=st.lists(st.integers(0, 70), max_size=12, unique=True), aiding_s=st.integers(0, 60))
def test_whatever_another_set_does_the_window_stays(tmp_path_factory, resets: list[int], aiding_s: int) -> None:
    present = MadeSet(resets_s=(33.0,))
    other = MadeSet(resets_s=tuple(map(float, resets)), aiding_s=float(aiding_s))
    made = records(tmp_path_factory.mktemp("flight"), {"present": present, "other": other})
    alone = scoring_window(made[0], AIRBORNE, (), SETTINGS)
    beside = alone.of_set(made[1], SETTINGS)
    assert (alone.intervals, alone.cuts, alone.warm_up_end) == (beside.intervals, beside.cuts, beside.warm_up_end)


def test_a_present_set_that_resets_often_leaves_what_lies_between(tmp_path: Path) -> None:
    restless = tuple(float(s) for s in range(12, 58, 4))
    made = records(tmp_path, {"present": MadeSet(resets_s=restless)})
    window = scoring_window(made[0], AIRBORNE, (), SETTINGS)
    # 1.5 s before the first cut, half a second between each two of the twelve, and 11 s after the last
    assert window.duration_s == pytest.approx(1.5 + 11 * 0.5 + 11.0)


def test_a_diverged_set_is_left_out_with_its_reason(tmp_path: Path) -> None:
    made = records(tmp_path, {"present": MadeSet(), "broken": MadeSet(status="diverged")})
    window = scoring_window(made[0], AIRBORNE, (), SETTINGS)
    assert window.excluded == {}
    window = window.of_set(made[1], SETTINGS)
    assert window.excluded == {"broken": "diverged: the covariance is not finite"}


def test_a_flight_too_short_is_not_scored_and_says_why(tmp_path: Path) -> None:
    window = scoring_window(records(tmp_path, {"present": MadeSet()})[0], ((at(10.0), at(13.0)),), (), SETTINGS)
    assert not window.intervals
    assert window.reason == (
        "only 3.0 s of flight remain after the warm-up and the cuts, 5 s are needed: of 3.0 s in the air none is cut"
    )


def test_a_flight_that_is_cut_away_says_by_what(tmp_path: Path) -> None:
    """Resets at 12, 15, … 69 s, each with 3 s to follow, take all that the warm-up leaves, which ends at 14.89 s."""
    restless = tuple(float(s) for s in range(9, 70, 3))
    made = records(tmp_path, {"present": MadeSet(aiding_s=10.0, resets_s=restless)})
    window = scoring_window(made[0], AIRBORNE, ((at(30.0), at(32.0)),), SETTINGS)
    assert not window.intervals
    assert window.reason == (
        "only 0.0 s of flight remain after the warm-up and the cuts, 5 s are needed: of 60.0 s in the air "
        "20 resets of horizontal position take 55.1 s, 1 gap in the log takes 5.0 s, the warm-up takes 4.9 s"
    )


def test_a_log_without_flight_is_not_scored(tmp_path: Path) -> None:
    window = scoring_window(records(tmp_path, {"present": MadeSet()})[0], (), (), SETTINGS)
    assert window.reason == "the log holds no flight time"


def test_blocks_share_the_window_equally(tmp_path: Path) -> None:
    window = scoring_window(records(tmp_path, {"present": MadeSet()})[0], AIRBORNE, (), SETTINGS)
    edges = window.block_edges(10.0)
    assert edges[0] == AIRBORNE[0][0]
    assert edges[-1] == AIRBORNE[0][1]
    np.testing.assert_array_equal(np.diff(edges), np.full(6, 10_000_000))
