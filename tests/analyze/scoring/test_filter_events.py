"""Resets, lost sources, faults and time without aid are counted in flight only."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.analyze.made_flight import MadeSet, at, make_flight

from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.analyze.replaying.store.reader import read_set
from fusetune.analyze.scoring.filter_events import filter_events

FLIGHT = ((at(10.0), at(70.0)),)


def record(root: Path, made: MadeSet) -> ReplayedSet:
    _, folder = make_flight(root, "flight", {"one": made})
    return read_set(folder, "one")


def test_resets_on_the_ground_do_not_count(tmp_path: Path) -> None:
    events = filter_events(record(tmp_path, MadeSet(resets_s=(3.0, 20.0, 50.0))), FLIGHT)
    assert events.resets["horizontal_position"] == 2
    assert events.total_resets == 2


def test_a_source_that_stops_in_flight_is_a_timeout_and_costs_time(tmp_path: Path) -> None:
    events = filter_events(record(tmp_path, MadeSet(lost_gnss_s=40.0)), FLIGHT)
    assert events.timeouts["gnss_pos"] == 1
    assert events.dead_reckoning_s == pytest.approx(2.0)


def test_a_quiet_flight_has_none(tmp_path: Path) -> None:
    events = filter_events(record(tmp_path, MadeSet()), FLIGHT)
    assert (events.total_resets, events.total_timeouts, events.fault_flags, events.faults) == (0, 0, 0, ())
    assert events.dead_reckoning_s == 0.0


def test_faults_are_named(tmp_path: Path) -> None:
    events = filter_events(record(tmp_path, MadeSet(fault_flags=8)), FLIGHT)
    assert events.faults == ("fs_bad_hdg",)
    assert events.fault_flags == 8


def test_a_counter_that_wraps_or_jumps_counts_every_step(tmp_path: Path) -> None:
    one = record(tmp_path, MadeSet())
    counter = np.zeros(one.local_position["timestamp"].size, dtype=np.uint8)
    counter[:300], counter[300:400], counter[400:] = 255, 0, 3
    one = replace(one, local_position={**one.local_position, "xy_reset_counter": counter})
    assert one.reset_times["horizontal_position"].size == 1 + 3


def with_samples(one: ReplayedSet, samples: AxisSamples) -> ReplayedSet:
    return replace(one, samples={**one.samples, ("gnss_vel", 0): samples})


def test_how_a_source_served_is_told_by_its_fused_samples(tmp_path: Path) -> None:
    # One sample every 0.2 s, stamped 0.11 s before it: of 300 in flight, those of 20 s to 30 s are not fused.
    one = record(tmp_path, MadeSet())
    samples = one.samples["gnss_vel", 0]
    lost = (samples.timestamp_sample >= at(20.0)) & (samples.timestamp_sample < at(30.0))
    samples.fused[lost] = False
    aid = filter_events(with_samples(one, samples), FLIGHT).aid["gnss_vel"]
    assert aid.samples == 300
    assert aid.fused_share == pytest.approx(250 / 300)
    assert aid.longest_without_s == pytest.approx(10.2)


def test_a_source_that_was_never_fused_served_nothing(tmp_path: Path) -> None:
    one = record(tmp_path, MadeSet())
    samples = one.samples["gnss_vel", 0]
    samples.fused[:] = False
    assert "gnss_vel" not in filter_events(with_samples(one, samples), FLIGHT).aid
