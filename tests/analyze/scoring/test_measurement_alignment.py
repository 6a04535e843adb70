"""Sets with other delays, and sets that miss samples, are scored on the same measurements."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.analyze.made_flight import MadeSet, at, make_flight

from fusetune.analyze.flight.intervals import Cut
from fusetune.analyze.metrics.likelihood import winsor_limit
from fusetune.analyze.replaying.measurement_times import match
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import SampleSpool
from fusetune.analyze.replaying.store.reader import read_set
from fusetune.analyze.scoring.charges import EvidenceCost
from fusetune.analyze.scoring.measurement_alignment import FIGURES, narrowed, paired_samples
from fusetune.analyze.scoring.metrics_table import MetricsTable
from fusetune.analyze.scoring.sample_scores import score_samples
from fusetune.analyze.scoring.settings import ScoringSettings
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


def without_samples(one: ReplayedSet, between_s: tuple[float, float]) -> ReplayedSet:
    """The same set without its GNSS velocity north between two times."""
    samples = one.samples["gnss_vel", 0]
    time = samples.timestamp_sample
    return replace(
        one,
        samples={
            ("gnss_vel", 0): samples.rows((time < at(between_s[0]) - 110_000) | (time >= at(between_s[1]) - 110_000))
        },
    )


def test_what_a_set_lacks_counts_with_the_limit_and_takes_nothing_from_the_others(tmp_path: Path) -> None:
    """Of 50 measurements from 20 to 30 s the 5 from 24 s on, and one alone at 28 s."""
    sets = {name: MadeSet(own=0.5) for name in ("present", "good", "patchy")}
    _, folder = make_flight(tmp_path, "flight", sets)
    now, good, patchy = (read_set(folder, name) for name in sets)
    patchy = without_samples(without_samples(patchy, (24.0, 25.0)), (28.0, 28.2))
    pairs = paired_samples([now, patchy, good], ("gnss_vel", 0), "present", WINDOW)
    without = paired_samples([now, good], ("gnss_vel", 0), "present", WINDOW)
    assert pairs is not None
    assert without is not None
    assert pairs.sets == ("present", "patchy", "good")
    assert pairs.complete == (True, False, True)
    assert pairs.costs["patchy"] == EvidenceCost(mask=50, lacking=6, after_reset=0)
    first, own, other = pairs.each()
    for one, alone in zip((first, other), without.each(), strict=True):
        for name in FIGURES:
            np.testing.assert_array_equal(getattr(one, name), getattr(alone, name))
    assert pairs.winsor_limit == without.winsor_limit
    counted = np.abs(own.innovation[0])
    np.testing.assert_allclose(counted[20:25], pairs.winsor_limit, rtol=1e-6)
    assert own.rejected[0, 20:25].all()
    usual = np.sqrt(np.mean(np.square(np.delete(counted, [*range(20, 25), 40]))))
    assert counted[40] == pytest.approx(max(usual, abs(first.innovation[0, 40])), rel=1e-6)
    assert not own.rejected[0, 40]


def test_a_set_that_lacks_more_than_the_share_is_left_out(tmp_path: Path) -> None:
    sets = {name: MadeSet() for name in ("present", "patchy")}
    _, folder = make_flight(tmp_path, "flight", sets)
    now, patchy = (read_set(folder, name) for name in sets)
    patchy = without_samples(patchy, (24.0, 27.0))
    pairs = paired_samples([now, patchy], ("gnss_vel", 0), "present", WINDOW)
    assert pairs is not None
    assert pairs.sets == ("present",)
    assert pairs.costs["patchy"] == EvidenceCost(mask=50, lacking=15, after_reset=0)
    lenient = paired_samples(
        [now, patchy], ("gnss_vel", 0), "present", WINDOW, settings=ScoringSettings(max_lacking_percent=30.0)
    )
    assert lenient is not None
    assert lenient.sets == ("present", "patchy")


def test_what_a_set_had_not_fused_yet_it_lacks(tmp_path: Path) -> None:
    sets = {"present": MadeSet(), "late": MadeSet(aiding_s=21.0)}
    _, folder = make_flight(tmp_path, "flight", sets)
    pairs = paired_samples([read_set(folder, name) for name in sets], ("gnss_vel", 0), "present", WINDOW)
    assert pairs is not None
    # the measurements of the first second, at 5 Hz
    assert pairs.costs["late"] == EvidenceCost(mask=50, lacking=5, after_reset=0)


def test_after_its_own_reset_a_set_shows_no_smaller_error_than_the_present_one(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.3, own=1.0), "tempting": MadeSet(error=0.01, own=1.0)}
    _, folder = make_flight(tmp_path, "flight", sets)
    made = [read_set(folder, name) for name in sets]
    window = replace(WINDOW, own_resets={"tempting": (Cut(at(22.0), at(24.0), "reset"),)})
    pairs = paired_samples(made, ("gnss_vel", 0), "present", window)
    assert pairs is not None
    present, tempting = pairs.each()
    np.testing.assert_allclose(tempting.innovation[0, 10:20], present.innovation[0, 10:20], rtol=1e-6)
    assert np.max(np.abs(tempting.innovation[0, 20:])) < 0.05
    assert pairs.costs["tempting"] == EvidenceCost(mask=50, lacking=0, after_reset=10)
    assert pairs.winsor_limit == winsor_limit(present.innovation)


def test_samples_that_are_charged_are_the_same_on_the_disk(tmp_path: Path) -> None:
    sets = {name: MadeSet(own=0.5) for name in ("present", "patchy", "good")}
    _, folder = make_flight(tmp_path, "flight", sets)
    now, patchy, good = (read_set(folder, name) for name in sets)
    records = [now, without_samples(patchy, (24.0, 25.0)), good]
    in_memory, on_disk = (
        paired_samples(records, ("gnss_vel", 0), "present", WINDOW, spool) for spool in (None, SampleSpool(tmp_path))
    )
    assert in_memory is not None
    assert on_disk is not None
    assert in_memory.winsor_limit == on_disk.winsor_limit
    for one, other in zip(in_memory.each(), on_disk.each(), strict=True):
        assert one.sets == other.sets
        np.testing.assert_array_equal(one.innovation, other.innovation)


def test_a_source_that_only_another_set_fuses_has_figures_but_no_say(tmp_path: Path) -> None:
    """Blocks of it would leave the present set without a score beside that other one."""
    sets = {name: MadeSet() for name in ("present", "other")}
    _, folder = make_flight(tmp_path, "flight", sets)
    now, other = (read_set(folder, name) for name in sets)
    now = replace(now, samples={key: now.samples[key] for key in now.samples if key[0] != "baro_hgt"})
    table = MetricsTable("flight")
    scores = score_samples(table, [now, other], "present", WINDOW, ScoringSettings())
    assert set(scores.blocks["source"].to_pylist()) == {"gnss_vel", "gnss_pos"}
    figures = table.finished().to_pylist()
    assert {row["set"] for row in figures if row["source"] == "baro_hgt"} == {"other"}
    assert ("baro_hgt", 0) not in scores.costs
