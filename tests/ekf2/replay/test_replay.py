"""The whole estimator: invariances on a simulated flight, and agreement with PX4's own estimator."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.ekf2.replay.equal_rows import assert_equal_rows
from tests.ekf2.replay.px4_agreement import Limits, assert_replay_agrees

from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.filter.common.parameters import complete
from fusetune.ekf2.replay.course import RUNS_PER_STRETCH
from fusetune.ekf2.replay.recording import SCORING, TRACED, joined, with_fields
from fusetune.ekf2.replay.replay import replay, replay_into
from fusetune.ekf2.replay.results import ReplaySummary
from fusetune.px4.flight import Flight
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS

LATITUDE_DEG_M = 111_132.0
PUBLISHED = ("innovations", "states", "local_position", "flags")


@pytest.fixture(scope="module")
def flight(survey_flight) -> Flight:
    return survey_flight


def replayed(flight: Flight, **overrides: float):
    return replay(build_inputs(flight), complete(flight.parameters.initial, overrides, flight.release))


@pytest.fixture(scope="module")
def result(flight):
    return replayed(flight)


def shifted(flight: Flight, shift_us: int) -> Flight:
    """The same flight on a vehicle that booted earlier."""
    topics = {
        key: {
            name: values + shift_us if name in ("timestamp", "timestamp_sample") else values
            for name, values in table.items()
        }
        for key, table in flight.topics.items()
    }
    for table in topics.values():
        if "timestamp_sample" in table:
            table["timestamp_sample"] = np.where(table["timestamp_sample"] == shift_us, 0, table["timestamp_sample"])
    return dataclasses.replace(flight, topics=topics)


def test_rows_are_handed_on_a_stretch_at_a_time(flight, result):
    pieces = []
    parameters = complete(flight.parameters.initial, {}, flight.release)
    summary = replay_into(pieces.append, build_inputs(flight), parameters)
    assert len(pieces) > 2
    assert all(len(piece.states) <= RUNS_PER_STRETCH for piece in pieces)
    whole = joined(pieces)
    for name in PUBLISHED:
        assert_equal_rows(getattr(whole, name), getattr(result, name))
    for field in dataclasses.fields(summary):
        assert getattr(summary, field.name) == getattr(result, field.name)
    assert summary.updates == len(result.states)
    assert summary.update_interval_us == np.median(np.diff(result.states["timestamp_sample"]))
    assert summary.resets["heading_reset_counter"] == result.local_position["heading_reset_counter"][-1]
    assert not summary.diverged


def test_only_what_is_asked_for_is_kept(flight, result):
    def keep(rows):
        vertical = rows.innovations[rows.innovations["axis"] == 2]
        return rows._replace(innovations=vertical, states=with_fields(rows.states, ["timestamp"]))

    kept = replay(build_inputs(flight), complete(flight.parameters.initial, {}, flight.release), keep=keep)
    assert kept.states.dtype.names == ("timestamp",)
    np.testing.assert_array_equal(kept.states["timestamp"], result.states["timestamp"])
    assert_equal_rows(kept.innovations, result.innovations[result.innovations["axis"] == 2])


def test_two_replays_give_the_same_bits(flight, result):
    again = replayed(flight)
    for name in PUBLISHED:
        assert_equal_rows(getattr(again, name), getattr(result, name))


def test_later_boot_changes_nothing_but_time_stamps(flight):
    """Counted from an hour after boot: timers that never ran count from 0 in PX4, which the first seconds feel."""
    hour_us = 3_600_000_000
    early, late = (replayed(shifted(flight, hours * hour_us)) for hours in (1, 2))
    assert_equal_rows(
        late.innovations, early.innovations, ("source", "axis", "innovation", "innovation_variance", "fused")
    )
    assert_equal_rows(late.states, early.states, ("states", "covariances"))
    np.testing.assert_array_equal(late.states["timestamp"] - hour_us, early.states["timestamp"])


def test_quaternion_stays_unit_and_variances_positive(result):
    np.testing.assert_allclose(np.linalg.norm(result.states["states"][:, :4], axis=1), 1.0, atol=1e-6)
    assert (result.states["covariances"] >= 0).all()
    assert not result.diverged


def test_every_parameter_at_its_default_equals_the_parameter_unset(flight):
    unset = complete({}, {}, flight.release)
    assert complete({}, {name: metadata.default for name, metadata in PARAMETERS.items()}, flight.release) == unset


def test_rotating_the_world_rotates_the_answer(flight):
    """Without a magnetometer nothing but GNSS knows north; the turning Earth is felt too little to matter here."""
    angle = np.deg2rad(70.0)
    c, s = np.cos(angle), np.sin(angle)
    gnss = dict(flight.topics["vehicle_gps_position", 0])
    north, east = gnss["vel_n_m_s"].astype(float), gnss["vel_e_m_s"].astype(float)
    gnss["vel_n_m_s"], gnss["vel_e_m_s"] = c * north - s * east, s * north + c * east
    lat0, lon0 = gnss["latitude_deg"][0], gnss["longitude_deg"][0]
    across = np.cos(np.deg2rad(lat0))
    y, x = gnss["latitude_deg"] - lat0, (gnss["longitude_deg"] - lon0) * across
    gnss["latitude_deg"], gnss["longitude_deg"] = lat0 + c * y - s * x, lon0 + (s * y + c * x) / across
    turned = flight.with_topics(flight.topics | {("vehicle_gps_position", 0): gnss})
    plain, rotated = (replayed(f, EKF2_MAG_TYPE=5.0) for f in (flight, turned))
    half = len(plain.states) // 2
    a, b = plain.states["states"][half:], rotated.states["states"][half:]
    expected = np.column_stack([c * a[:, 4] - s * a[:, 5], s * a[:, 4] + c * a[:, 5]])
    assert np.sqrt(np.mean((b[:, 4:6] - expected) ** 2)) < 0.02
    turn = np.unwrap(_yaw(b)) - np.unwrap(_yaw(a))
    assert abs(np.angle(np.mean(np.exp(1j * (turn - angle))))) < np.deg2rad(1.0)


def _yaw(states):
    w, x, y, z = states[:, :4].T
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2))


def test_log_change_of_a_parameter_acts_from_its_time_on_unless_overridden(flight, result):
    from fusetune.px4.flight import ParameterChange

    times = flight.topics["sensor_combined", 0]["timestamp"]
    middle = int(times[len(times) // 2])
    changed = dataclasses.replace(
        flight,
        parameters=dataclasses.replace(flight.parameters, changed=[ParameterChange(middle, "EKF2_GPS_V_NOISE", 3.0)]),
    )
    after = replayed(changed)
    horizon = result.states["timestamp"] < middle
    np.testing.assert_array_equal(after.states["states"][horizon], result.states["states"][horizon])
    assert not np.array_equal(after.states["states"][~horizon], result.states["states"][~horizon])
    values = complete(flight.parameters.initial, {"EKF2_GPS_V_NOISE": 3.0}, flight.release)
    whole = replay(build_inputs(flight), values)
    overridden = replay(build_inputs(changed), values, overridden=frozenset({"EKF2_GPS_V_NOISE"}))
    np.testing.assert_array_equal(whole.states["states"], overridden.states["states"])


def test_obsolete_magnetometer_type_set_in_flight_counts_as_automatic(flight, result):
    """PX4 checks its parameters whenever they change: 2 (3D fusion, until v1.15) becomes 0, which it was before."""
    from fusetune.px4.flight import ParameterChange

    middle = int(flight.topics["sensor_combined", 0]["timestamp"][5000])
    obsolete = [ParameterChange(middle, "EKF2_MAG_TYPE", 2.0)]
    changed = dataclasses.replace(flight, parameters=dataclasses.replace(flight.parameters, changed=obsolete))
    assert_equal_rows(replayed(changed).states, result.states, ("states", "covariances"))


@pytest.mark.parametrize(
    ("source", "switched_off"), [("mag", {"EKF2_MAG_TYPE": 5.0}), ("drag", {"EKF2_DRAG_CTRL": 0.0})]
)
def test_sensor_switched_on_in_flight_starts_with_what_waits(flight, source, switched_off):
    """PX4 takes no sample of what is switched off: the newest of the last 0.1 s is there when it is switched on.

    Of drag not even means are made while it is off, so that the first one is still to come.
    """
    from fusetune.px4.flight import ParameterChange

    times = flight.topics["sensor_combined", 0]["timestamp"]
    ((name, off),) = switched_off.items()
    on = {"EKF2_MAG_TYPE": 0.0, "EKF2_DRAG_CTRL": 1.0}[name]
    initial = complete(flight.parameters.initial, {name: off}, flight.release)
    for run in range(6000, 6004):
        changed = [ParameterChange(int(times[run]), name, on)]
        parameters = dataclasses.replace(flight.parameters, changed=changed)
        after = replay(build_inputs(dataclasses.replace(flight, parameters=parameters)), initial)
        rows = after.innovations[after.source_names() == source]
        first_update = np.searchsorted(after.states["timestamp"], times[run])
        horizon = after.states["timestamp_sample"][first_update]
        if source == "mag":
            assert horizon - 100_000 < rows["timestamp_sample"][0] <= horizon
        else:
            assert rows["timestamp_sample"][0] > horizon


LOGS = (
    "JAParedes__TestFlight1", "Parham-Oveissi__log_40_2023-5-25-12-28-14", "SkyRats__log_29_2021-7-9-16-25-06",
    "Chainplain__log_9_2024-10-14-15-00-06", "erdemarslan380__sitl_windy", "synthetic__mc_gnss", "synthetic__mc_range",
    "synthetic__mc_flow", "synthetic__mc_vision", "synthetic__mc_gnss_yaw", "synthetic__mc_no_mag",
    "synthetic__mc_drag", "synthetic__fw_airspeed", "synthetic__mc_gravity",
)  # fmt: skip


MADE_AND_REAL = Limits(relative_rms=0.002, variance=5e-4, velocity_rms=0.005, attitude_rms_deg=0.05)


@pytest.mark.parametrize("name", LOGS)
def test_replay_is_that_of_px4(shared_logs, shared_reference, tmp_path, name):
    """Expected: what PX4 v1.16's own EKF2 computes on the same log, for every parameter set of the reference."""
    assert_replay_agrees(shared_logs / f"{name}.ulg", shared_reference / name, tmp_path, MADE_AND_REAL)


RANDOM_LIMITS = {"synthetic__mc_flow": 0.008, "synthetic__mc_vision": 0.004}
"""Largest relative difference of any axis; elsewhere 0.0015. What remains is PX4's single precision."""


@pytest.mark.parametrize(
    "name", [f"synthetic__{kind}" for kind in ("fw_airspeed", "mc_drag", "mc_flow", "mc_range", "mc_vision")]
)
def test_replay_is_that_of_px4_with_random_parameters(shared_logs, shared_reference_random, tmp_path, name):
    """Expected: what PX4 v1.16's own EKF2 computes with some 120 parameters drawn at once from their ranges."""
    limits = Limits(
        relative_rms=RANDOM_LIMITS.get(name, 0.0015),
        median_relative_rms=0.003,
        variance=1e-3,
        velocity_rms=0.01,
        attitude_rms_deg=0.05,
    )
    found = assert_replay_agrees(shared_logs / f"{name}.ulg", shared_reference_random / name, tmp_path, limits)
    assert len(found) == 6


def test_a_scoring_recording_has_the_figures_of_a_full_one(flight, result):
    """Steps and their neighbours are found here in the full rows, over all of the flight at once."""
    scored = replay(build_inputs(flight), complete(flight.parameters.initial, {}, flight.release), recording=SCORING)
    assert_equal_rows(scored.innovations, result.innovations)
    assert_equal_rows(scored.flags, result.flags)
    states = {"quaternion": "states", "velocity": "states"}
    firsts = {"quaternion": 0, "velocity": 4, "attitude_variance": 0, "velocity_variance": 3, "position_variance": 6}
    np.testing.assert_array_equal(scored.states["timestamp_sample"], result.states["timestamp_sample"])
    for name, first in firsts.items():
        of = result.states[states.get(name, "covariances")]
        np.testing.assert_array_equal(scored.states[name], of[:, first : first + scored.states[name].shape[1]])
    rows = result.local_position
    counters = np.stack([rows[name] for name in rows.dtype.names if name.endswith("_reset_counter")])
    steps = np.flatnonzero(np.diff(counters).any(axis=0)) + 1
    assert len(steps) > 2
    kept = sorted({0, len(rows) - 1} | {row for step in steps for row in range(max(step - 2, 0), step + 1)})
    assert_equal_rows(scored.local_position, rows[kept])
    traced = replay(build_inputs(flight), complete(flight.parameters.initial, {}, flight.release), recording=TRACED)
    assert_equal_rows(traced.local_position, rows)
    for name in ("innovations", "flags", "states"):
        assert_equal_rows(getattr(traced, name), getattr(scored, name))
    for field in dataclasses.fields(ReplaySummary):
        assert getattr(scored, field.name) == getattr(result, field.name)
