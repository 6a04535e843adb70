"""Following the vehicle's filter: a replay put back to each logged state."""

from dataclasses import replace

import numpy as np
import pytest

from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.filter.common.parameters import complete
from fusetune.ekf2.replay.following import follow
from fusetune.ekf2.replay.replay import begin_course
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.logged_state import logged_states


@pytest.fixture(scope="module")
def flight(survey_flight) -> Flight:
    """Simulated, with the states that this estimator had on board."""
    return survey_flight


def departures(flight, states, start=None):
    params = complete(flight.parameters.initial, {}, flight.release)
    return list(follow(build_inputs(flight), params, states, start))


def test_a_replay_of_every_sample_does_not_depart(flight):
    """Same samples, same filter: what is left is the precision of the logged numbers (float32)."""
    found = departures(flight, tuple(logged_states(flight))[::5])
    assert len(found) > 150
    assert max(abs(one.heading) for one in found) < 2e-6
    assert max(np.abs([one.mag_earth, one.mag_body]).max() for one in found) < 1e-6
    assert all(one.since < one.until for one in found)


def test_a_departure_is_vehicle_less_replay_and_is_forgotten_afterwards(flight):
    """One logged state is turned by 0.02 rad and given another field: it and its successor show that, with both signs.

    The successor's replay began from the false state, of which the filter keeps nearly all for a tenth of a second.
    """
    states = [state for state in logged_states(flight) if state.is_aligned]
    middle = len(states) // 2
    turn = np.array([np.cos(0.01), 0.0, 0.0, np.sin(0.01)])
    w, x, y, z = states[middle].q
    turned = np.array([turn[0] * w - turn[3] * z, turn[0] * x - turn[3] * y, turn[0] * y + turn[3] * x,
                       turn[0] * z + turn[3] * w])  # fmt: skip
    earth = states[middle].mag_earth + np.array([0.0, 0.0, 0.01])
    states[middle] = replace(states[middle], q=turned, mag_earth=earth)
    found = {one.until: one for one in departures(flight, states)}
    times = sorted(found)
    at = int(np.searchsorted(times, states[middle].time_us))
    here, after, later = (found[times[at + number]] for number in (0, 1, 10))
    assert here.heading == pytest.approx(0.02, abs=1e-4)
    np.testing.assert_allclose(here.mag_earth, [0.0, 0.0, 0.01], atol=1e-5)
    assert after.heading == pytest.approx(-0.02, rel=0.2)
    assert after.mag_earth[2] == pytest.approx(-0.01, rel=0.2)
    assert abs(later.heading) < 2e-3


def test_following_can_begin_from_a_logged_state(flight):
    states = [state for state in logged_states(flight) if state.is_aligned and state.uses_gnss]
    found = departures(flight, states, states[0])
    assert found[0].since >= states[0].time_us
    assert len(found) == len(states) - 1


def test_a_course_stops_at_the_first_run_after_which_the_horizon_has_come_to_a_time(flight):
    """As one that goes on by single runs and looks at the horizon after each."""
    inputs = build_inputs(flight)
    params = complete(flight.parameters.initial, {}, flight.release)
    (course, run, _), (slow, single, _) = (begin_course(inputs, params) for _ in range(2))
    start = int(inputs.arrays.imu["time_us"][0])
    for wanted in (start + 1_234_567, start + 1_234_568, start + 3_000_000):
        run = course.reach(run, wanted)
        while slow.ekf["time_delayed_us"][0] < wanted:
            slow.advance(single, single + 1)
            single += 1
        assert run == single
        assert course.ekf.tobytes() == slow.ekf.tobytes()
    samples = len(inputs.arrays.imu)
    assert course.reach(samples - 2, int(inputs.arrays.imu["time_us"][-1]) + 1) == samples
