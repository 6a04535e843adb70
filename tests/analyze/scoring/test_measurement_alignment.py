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
from fusetune.analyze.replaying.store.reader import read_set
from fusetune.analyze.scoring.charges import EvidenceCost
from fusetune.analyze.scoring.measurement_alignment import (
    FIGURES,
    Counted,
    CountedSamples,
    SampleMask,
    axes_together,
    counted_samples,
    own_samples,
    sample_mask,
    sample_masks,
)
from fusetune.analyze.scoring.metrics_table import MetricsTable
from fusetune.analyze.scoring.sample_scores import counted as counted_at
from fusetune.analyze.scoring.sample_scores import counted_of_its_own, score_samples
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.window import ScoringWindow

WINDOW = ScoringWindow(((at(20.0), at(30.0)),), (), {}, at(20.0))


KEY = ("gnss_vel", 0)


def mask_of(present: ReplayedSet) -> SampleMask:
    found = sample_mask(present, KEY, WINDOW)
    assert found is not None
    return found


def counted(present: ReplayedSet, other: ReplayedSet, most_lacking: float = 20.0) -> Counted:
    """Samples of another set at the measurements of the present one."""
    return counted_samples(mask_of(present), other, WINDOW.of_set(other, ScoringSettings()), most_lacking)


def samples_of(found: Counted) -> CountedSamples:
    assert found.samples is not None
    return found.samples


def test_another_delay_is_the_same_measurement(tmp_path: Path) -> None:
    sets = {"present": MadeSet(own=0.0), "delayed": MadeSet(own=0.0, overrides={"EKF2_GPS_DELAY": 200.0})}
    _, folder = make_flight(tmp_path, "flight", sets)
    made = [read_set(folder, name) for name in sets]
    assert made[0].samples[KEY].timestamp_sample[0] != made[1].samples[KEY].timestamp_sample[0]
    delayed = samples_of(counted(*made))
    assert delayed.mask.time.size == 50
    np.testing.assert_array_equal(own_samples(delayed.mask, made[0].samples[KEY]).innovation, delayed.innovation)


def test_gated_samples_stay_in(tmp_path: Path) -> None:
    _, folder = make_flight(tmp_path, "flight", {"present": MadeSet(error=1.0, claimed=0.1)})
    present = read_set(folder, "present")
    found = own_samples(mask_of(present), present.samples[KEY])
    assert found.rejected.size == 50
    assert 0.3 < np.mean(found.rejected) < 0.9


def test_of_a_source_that_the_set_does_not_fuse_there_is_no_mask(tmp_path: Path) -> None:
    _, folder = make_flight(tmp_path, "flight", {"present": MadeSet()})
    assert sample_mask(read_set(folder, "present"), ("ev_pos", 0), WINDOW) is None


def test_the_present_set_at_its_own_mask_is_as_any_other_set(tmp_path: Path) -> None:
    _, folder = make_flight(tmp_path, "flight", {"present": MadeSet(resets_s=())})
    present = read_set(folder, "present")
    own, like = own_samples(mask_of(present), present.samples[KEY]), samples_of(counted(present, present))
    for name in FIGURES:
        np.testing.assert_array_equal(getattr(own, name), getattr(like, name))


def test_axes_that_share_their_times_are_together(tmp_path: Path) -> None:
    _, folder = make_flight(tmp_path, "flight", {"present": MadeSet()})
    present = read_set(folder, "present")
    masks = sample_masks(present, WINDOW)
    own = counted_of_its_own(present, masks)
    found = {one.source: one for each in own for one in axes_together(each.values())}
    assert {name: one.axes for name, one in found.items()} == {
        "gnss_vel": [0, 1, 2], "gnss_pos": [0, 1], "baro_hgt": [0],
    }  # fmt: skip
    together = found["gnss_vel"].innovations
    assert together.innovation.shape == (1, 3, 50)
    (limits,) = together.winsor_limits()
    np.testing.assert_array_equal(np.ravel(limits), [masks["gnss_vel", axis].winsor_limit for axis in range(3)])
    assert {name: one.innovation.shape for name, one in found["gnss_vel"].groups()} == {
        "horizontal": (2, 1, 50), "vertical": (1, 1, 50), "all": (3, 1, 50),
    }  # fmt: skip


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


def test_what_a_set_lacks_counts_with_the_limit(tmp_path: Path) -> None:
    """Of 50 measurements from 20 to 30 s the 5 from 24 s on, and one alone at 28 s."""
    sets = {name: MadeSet(own=0.5) for name in ("present", "patchy")}
    _, folder = make_flight(tmp_path, "flight", sets)
    now, patchy = (read_set(folder, name) for name in sets)
    patchy = without_samples(without_samples(patchy, (24.0, 25.0)), (28.0, 28.2))
    found = counted(now, patchy)
    assert found.cost == EvidenceCost(mask=50, lacking=6, after_reset=0)
    own = samples_of(found)
    first = own_samples(own.mask, now.samples[KEY])
    assert own.mask.winsor_limit == winsor_limit(first.innovation.copy())
    magnitude = np.abs(own.innovation)
    np.testing.assert_allclose(magnitude[20:25], own.mask.winsor_limit, rtol=1e-6)
    assert own.rejected[20:25].all()
    usual = np.sqrt(np.mean(np.square(np.delete(magnitude, [*range(20, 25), 40]))))
    assert magnitude[40] == pytest.approx(max(usual, abs(first.innovation[40])), rel=1e-6)
    assert not own.rejected[40]


def test_a_set_that_lacks_more_than_the_share_is_left_out(tmp_path: Path) -> None:
    sets = {name: MadeSet() for name in ("present", "patchy")}
    _, folder = make_flight(tmp_path, "flight", sets)
    now, patchy = (read_set(folder, name) for name in sets)
    patchy = without_samples(patchy, (24.0, 27.0))
    found = counted(now, patchy)
    assert found.samples is None
    assert found.cost == EvidenceCost(mask=50, lacking=15, after_reset=0)
    assert counted(now, patchy, most_lacking=30.0).samples is not None


def test_what_a_set_had_not_fused_yet_it_lacks(tmp_path: Path) -> None:
    sets = {"present": MadeSet(), "late": MadeSet(aiding_s=21.0)}
    _, folder = make_flight(tmp_path, "flight", sets)
    # the measurements of the first second, at 5 Hz
    assert counted(*(read_set(folder, name) for name in sets)).cost == EvidenceCost(mask=50, lacking=5, after_reset=0)


def test_after_its_own_reset_a_set_shows_no_smaller_error_than_the_present_one(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.3, own=1.0), "tempting": MadeSet(error=0.01, own=1.0)}
    _, folder = make_flight(tmp_path, "flight", sets)
    present, tempting = (read_set(folder, name) for name in sets)
    window = replace(WINDOW, own_resets={"tempting": (Cut(at(22.0), at(24.0), "reset"),)})
    found = counted_samples(mask_of(present), tempting, window, 20.0)
    own = samples_of(found)
    np.testing.assert_allclose(own.innovation[10:20], own.mask.innovation[10:20], rtol=1e-6)
    assert np.max(np.abs(own.innovation[20:])) < 0.05
    assert found.cost == EvidenceCost(mask=50, lacking=0, after_reset=10)


def test_a_source_that_only_another_set_fuses_has_figures_but_no_say(tmp_path: Path) -> None:
    """Blocks of it would leave the present set without a score beside that other one."""
    sets = {name: MadeSet() for name in ("present", "other")}
    _, folder = make_flight(tmp_path, "flight", sets)
    now, other = (read_set(folder, name) for name in sets)
    now = replace(now, samples={key: now.samples[key] for key in now.samples if key[0] != "baro_hgt"})
    table = MetricsTable("flight")
    masks = sample_masks(now, WINDOW)
    found = counted_at(other, masks, WINDOW, 20.0)
    (scores,) = score_samples({"other": table}, [found], masks, WINDOW, ScoringSettings())
    assert {one.source for one in scores.blocks} == {"gnss_vel", "gnss_pos"}
    figures = table.finished().to_pylist()
    assert {row["set"] for row in figures if row["source"] == "baro_hgt"} == {"other"}
    assert ("baro_hgt", 0) not in scores.costs
