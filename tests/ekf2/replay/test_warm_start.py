"""A replay that starts from a logged state: near the uncut replay, at once, and bit for bit repeatable."""

import dataclasses

import numpy as np
import pytest

from fusetune.ekf2.compiled.compilation import ensure_compiled
from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.filter.common.parameters import complete
from fusetune.ekf2.releases.behaviours import BASELINE
from fusetune.ekf2.replay.replay import replay
from fusetune.ekf2.replay.warm_start import rotation_matrix
from fusetune.px4.flight import Flight, select_rows
from fusetune.px4.layouts.logged_state import LoggedState

CUT_S = 45.0


@pytest.fixture(scope="module")
def flight(survey_flight) -> Flight:
    return survey_flight


def run(flight, **options):
    return replay(build_inputs(flight), complete(flight.parameters.initial, {}, flight.release), **options)


@pytest.fixture(scope="module")
def whole(flight):
    return run(flight)


def state_at(result, time_us) -> LoggedState:
    """What a vehicle would have logged: the states of a replay, in the layout of v1.16."""
    row = int(np.searchsorted(result.states["timestamp_sample"], time_us))
    states = result.states["states"][row].astype(float)
    local = result.local_position[int(np.searchsorted(result.local_position["timestamp"], time_us))]
    flags = result.flags[np.searchsorted(result.flags["timestamp"], time_us) - 1]
    from fusetune.ekf2.replay.recording import FLAG_COLUMNS

    names = [name for name, on in zip(FLAG_COLUMNS, flags["flags"], strict=True) if on and name.startswith("cs_")]
    return LoggedState(
        time_us=int(result.states["timestamp_sample"][row]),
        q=states[:4],
        velocity=states[4:7],
        position=np.array([local["x"], local["y"], states[9] + result.origin[2]]),
        origin=result.origin,
        gyro_bias=states[10:13],
        accel_bias=states[13:16],
        mag_earth=states[16:19],
        mag_body=states[19:22],
        wind=states[22:24],
        variances=result.states["covariances"][row].astype(float),
        flags=frozenset(name.removeprefix("cs_") for name in names),
    )


@pytest.fixture(scope="module")
def cut(flight, whole):
    """The flight from mid-air on, and the state that it had a second after the cut."""
    first = int(flight.topics["sensor_combined", 0]["timestamp"][0])
    begin = first + round(CUT_S * 1e6)
    topics = {}
    for key, table in flight.topics.items():
        rows = np.flatnonzero(table["timestamp"] >= begin)
        if key[0] in ("vehicle_status", "vehicle_land_detected") and rows[0] > 0:
            rows = np.concatenate([[rows[0] - 1], rows])
        topics[key] = select_rows(table, rows)
    return dataclasses.replace(flight, topics=topics), state_at(whole, begin + 1_000_000)


@pytest.mark.parametrize(
    ("release", "settled_rows", "height_limit"),
    # v1.14 and v1.13 fuse the heading that the field shows at the start; v1.13's height is the barometer's alone
    [(BASELINE, 100, 0.3), ("v1.15", 100, 0.3), ("v1.14", 1000, 0.3), ("v1.13", 1000, 0.8)],
)
def test_warm_start_in_mid_air_stays_close_to_the_uncut_replay(cut, whole, release, settled_rows, height_limit):
    flight, state = cut
    ensure_compiled(release)
    warm = run(flight, start=state, release=release)
    assert warm.warm_start_us is not None
    assert 0 <= warm.warm_start_us - state.time_us < 20_000
    np.testing.assert_allclose(warm.origin, whole.origin, atol=1e-9)
    at = np.searchsorted(whole.local_position["timestamp"], warm.local_position["timestamp"])
    at = np.minimum(at, len(whole.local_position) - 1)
    # a standard deviation of the velocity state is 0.06 m/s: the two differ by less than that
    for name, limit in (("vx", 0.06), ("vy", 0.06), ("vz", 0.06), ("x", 0.15), ("y", 0.15), ("z", height_limit)):
        difference = warm.local_position[name] - whole.local_position[name][at]
        assert np.sqrt(np.mean(difference[100:] ** 2)) < limit, name
    turn = warm.local_position["heading"] - whole.local_position["heading"][at]
    assert np.degrees(np.abs((turn + np.pi) % (2 * np.pi) - np.pi))[settled_rows:].max() < 3.0


def test_warm_start_fuses_at_once_and_resets_nothing(cut):
    flight, state = cut
    warm = run(flight, start=state)
    fused = warm.innovations[warm.innovations["fused"]]
    names = np.array(warm.source_names())[warm.innovations["fused"]]
    for source in ("gnss_vel", "gnss_pos", "baro_hgt", "mag"):
        assert fused["timestamp_sample"][names == source][0] - state.time_us < 500_000, source
    assert set(warm.resets.values()) == {0}
    cold = run(flight)
    cold_names = cold.source_names()[cold.innovations["fused"]]
    first = cold.innovations[cold.innovations["fused"]]["timestamp_sample"][cold_names == "gnss_vel"][0]
    assert first - state.time_us > 5_000_000


def test_warm_start_is_repeatable_and_leaves_the_inputs_alone(cut):
    flight, state = cut
    inputs = build_inputs(flight)
    params = complete(flight.parameters.initial, {}, flight.release)
    before = inputs.arrays.mag.copy()
    first, second = (replay(inputs, params, start=state) for _ in range(2))
    np.testing.assert_array_equal(inputs.arrays.mag, before)
    for field in ("innovation", "innovation_variance", "timestamp_sample"):
        np.testing.assert_array_equal(first.innovations[field], second.innovations[field])


def test_state_after_the_end_means_a_cold_start(cut):
    flight, state = cut
    late = dataclasses.replace(state, time_us=int(flight.topics["sensor_combined", 0]["timestamp"][-1]) + 10_000_000)
    result, cold = run(flight, start=late), run(flight)
    assert result.warm_start_us is None
    assert result.updates == cold.updates


def test_rotation_matrix_turns_forward_to_the_heading():
    """A yaw of 90° turns the body's x axis to east."""
    q = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    np.testing.assert_allclose(rotation_matrix(q) @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
