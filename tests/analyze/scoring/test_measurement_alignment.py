"""Sets with other delays, and sets that miss samples, are scored on the same measurements."""

from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from tests.analyze.made_flight import MadeSet, at, make_flight

from fusetune.analyze.replaying.measurement_times import match
from fusetune.analyze.replaying.samples import SampleSpool
from fusetune.analyze.replaying.store.reader import read_set
from fusetune.analyze.scoring.measurement_alignment import FIGURES, narrowed, paired_samples
from fusetune.analyze.scoring.window import ScoringWindow

WINDOW = ScoringWindow(((at(20.0), at(30.0)),), (), {}, at(20.0))


def test_another_delay_is_the_same_measurement(tmp_path: Path) -> None:
    sets = {"present": MadeSet(own=0.0), "delayed": MadeSet(own=0.0, overrides={"EKF2_GPS_DELAY": 200.0})}
    _, folder = make_flight(tmp_path, "flight", sets)
    made = [read_set(folder, name) for name in sets]
    assert made[0].samples["gnss_vel", 0].timestamp_sample[0] != made[1].samples["gnss_vel", 0].timestamp_sample[0]
    pairs = paired_samples(made, ("gnss_vel", 0), "present", WINDOW)
    assert pairs is not None
    assert pairs.time.size == 50
    present, delayed = pairs.each()
    np.testing.assert_array_equal(present.innovation, delayed.innovation)


def test_gated_samples_stay_in(tmp_path: Path) -> None:
    _, folder = make_flight(tmp_path, "flight", {"present": MadeSet(error=1.0, claimed=0.1)})
    pairs = paired_samples([read_set(folder, "present")], ("gnss_vel", 0), "present", WINDOW)
    assert pairs is not None
    assert pairs.time.size == 50
    (present,) = pairs.each()
    assert 0.3 < np.mean(present.rejected) < 0.9


def test_a_source_that_no_set_fuses_is_none(tmp_path: Path) -> None:
    _, folder = make_flight(tmp_path, "flight", {"present": MadeSet()})
    assert paired_samples([read_set(folder, "present")], ("ev_pos", 0), "present", WINDOW) is None


@given(
    dropped=st.sets(st.integers(0, 99), max_size=60),
    jitter=st.lists(st.integers(-3000, 3000), min_size=100, max_size=100),
)
def test_match_finds_each_sample_that_is_there_and_no_other(dropped: set[int], jitter: list[int]) -> None:
    reference = np.arange(100, dtype=np.int64) * 10_000
    kept = [k for k in range(100) if k not in dropped]
    time = reference[kept] + np.array(jitter, dtype=np.int64)[kept]
    found = match(reference, time, 4000.0)
    expected = {k: row for row, k in enumerate(kept)}
    assert [int(row) for row in found] == [expected.get(k, -1) for k in range(100)]


def test_samples_on_the_disk_are_those_in_memory(tmp_path: Path) -> None:
    sets = {"present": MadeSet(), "other": MadeSet(error=0.2)}
    _, folder = make_flight(tmp_path, "flight", sets)
    made = [read_set(folder, name) for name in sets]
    in_memory, on_disk = (
        paired_samples(made, ("gnss_vel", 0), "present", WINDOW, spool) for spool in (None, SampleSpool(tmp_path))
    )
    assert in_memory is not None
    assert on_disk is not None
    assert in_memory.winsor_limit == on_disk.winsor_limit
    for one, other in zip(in_memory.each(), on_disk.each(), strict=True):
        assert one.sets == other.sets
        for name in FIGURES:
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@given(values=st.lists(st.floats(width=64) | st.floats(width=32), max_size=20))
def test_nothing_is_lost_where_single_precision_is_enough(values: list[float]) -> None:
    given_values = np.array(values, np.float64)
    np.testing.assert_array_equal(narrowed(given_values).astype(np.float64), given_values)
    with np.errstate(over="ignore"):
        single = given_values.astype(np.float32)
    assert narrowed(single.astype(np.float64)).dtype == np.float32
