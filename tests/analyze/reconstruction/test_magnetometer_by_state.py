"""Noise of missing magnetometer samples, found by the states that the vehicle's filter logged."""

from dataclasses import replace

import numpy as np
import pytest

from fusetune.analyze.reconstruction import ReconstructionSettings, reconstruct
from fusetune.analyze.reconstruction.magnetometer_by_state import (
    add_noise_by_state,
    most_likely_offset,
    noise_of_measured,
    reaction_to_offset,
)
from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.replay.following import Departure, follow
from fusetune.px4.flight import Flight, row_count, select_rows
from fusetune.px4.layouts.logged_state import logged_states
from fusetune.px4.parameters.complete_sets import complete

FIELD = np.array([0.2, 0.05, 0.4])
MAG = "vehicle_magnetometer"


@pytest.fixture(scope="module")
def flight(survey_flight) -> Flight:
    """Magnetometer and estimator states at 2 Hz."""
    keep = {name: 5 if name == "estimator_states" else 25 for name in (MAG, "estimator_states")}
    topics = {key: table for key, table in survey_flight.topics.items() if key[0] != "ekf2_timestamps"}
    for name, step in keep.items():
        topics[name, 0] = select_rows(topics[name, 0], np.arange(0, row_count(topics[name, 0]), step))
    return survey_flight.with_topics(topics)


def departure(covariance: np.ndarray, to_earth: np.ndarray | None = None, **values) -> Departure:
    zero = np.zeros(3)
    defaults = Departure(1, 2, 0.0, zero, zero, covariance, np.eye(3) if to_earth is None else to_earth, FIELD, True)
    return replace(defaults, **values)


def test_reaction_to_one_sample_is_the_kalman_gain():
    """One sample, body field alone uncertain: the gain is P / (P + R) on each axis by hand."""
    covariance = np.diag([0.0] * 6 + [0.03, 0.02, 0.01])
    reaction = reaction_to_offset(departure(covariance), 1, 0.01)
    np.testing.assert_allclose(reaction[4:], np.diag([0.75, 2 / 3, 0.5]), atol=1e-12)
    np.testing.assert_allclose(reaction[:4], 0.0, atol=1e-12)


def test_reaction_to_many_samples_is_that_to_their_mean():
    """N samples that are off alike act as one of variance R / N: P / (P + R / N)."""
    covariance = np.diag([0.0] * 3 + [0.03] * 3 + [0.0] * 3)
    reaction = reaction_to_offset(departure(covariance), 20, 0.01)
    np.testing.assert_allclose(reaction[1:4], np.eye(3) * 0.03 / (0.03 + 0.01 / 20), atol=1e-9)


def test_an_offset_to_the_east_turns_the_heading_to_the_west():
    """Level, heading alone uncertain: a field seen too far to the right is a heading too far to the left.

    By hand: H = (m_E, -m_N, 0) about the down axis, gain P Hᵀ / (P |H|² + R).
    """
    covariance = np.diag([0.0, 0.0, 0.01] + [0.0] * 6)
    reaction = reaction_to_offset(departure(covariance), 1, 0.01)
    across = np.array([FIELD[1], -FIELD[0], 0.0])
    np.testing.assert_allclose(reaction[0], 0.01 * across / (0.01 * across @ across + 0.01), atol=1e-12)
    assert reaction[0, 1] < 0.0
    still = departure(covariance, turns_attitude=False)
    np.testing.assert_array_equal(reaction_to_offset(still, 1, 0.01)[0], 0.0)


def test_offset_is_found_from_what_it_makes_of_the_field():
    covariance = np.diag([1e-4, 1e-4, 3e-2] + [2e-3] * 3 + [1e-3] * 3)
    offset = np.array([1.0e-3, -0.5e-3, 0.7e-3])
    reaction = reaction_to_offset(departure(covariance), 25, 0.0025)
    moved = reaction @ offset
    found = most_likely_offset(
        reaction, departure(covariance, heading=moved[0], mag_earth=moved[1:4], mag_body=moved[4:]), 1.2e-3
    )
    np.testing.assert_allclose(found, offset, atol=0.1e-3)


def test_what_does_not_move_the_field_is_taken_for_none():
    nothing = departure(np.zeros((9, 9)), mag_earth=np.array([0.1, 0.0, 0.0]))
    np.testing.assert_array_equal(most_likely_offset(np.zeros((7, 3)), nothing, 1e-3), 0.0)


def test_noise_is_what_measured_samples_are_off_the_smooth_ones_around():
    random = np.random.default_rng(8)
    measured = np.arange(5000) % 10 == 5
    field = np.tile(FIELD, (5000, 1))
    field[measured] += 0.006 * random.standard_normal((500, 3))
    # 1500 values: the standard deviation of the estimate is 0.006 / √3000
    assert noise_of_measured(field, measured) == pytest.approx(0.006, abs=4 * 0.006 / np.sqrt(3000))
    assert noise_of_measured(field, np.ones(5000, bool)) == 0.0


def departures(flight: Flight) -> np.ndarray:
    """(N, 6) of the fields, of a flight with reconstructed topics against the states it logs."""
    params = complete(flight.parameters.initial, {}, flight.release)
    found = follow(build_inputs(flight), params, logged_states(flight))
    return np.array([np.concatenate([one.mag_earth, one.mag_body]) for one in found])


def test_replay_is_led_to_the_field_that_the_vehicle_logged(flight):
    plain = reconstruct(flight, ReconstructionSettings(magnetometer_by_state=False))
    led = reconstruct(flight, ReconstructionSettings())
    assert "with the noise that explains" in led.steps[1].what
    without, with_noise = (np.sqrt(np.median(departures(one.flight) ** 2)) for one in (plain, led))
    assert with_noise < 0.5 * without


def test_measured_samples_stay_as_they_are(flight):
    led = reconstruct(flight, ReconstructionSettings())
    measured = led.measured[MAG]
    for axis in range(3):
        column = f"magnetometer_ga[{axis}]"
        np.testing.assert_array_equal(led.flight.topics[MAG, 0][column][measured], flight.topics[MAG, 0][column])


def test_a_filter_that_moves_its_field_otherwise_is_not_followed(flight):
    """States whose field jumps to and fro by 0.05 Gauss are not led there by noise of 0.006 Gauss."""
    plain = reconstruct(flight, ReconstructionSettings(magnetometer_by_state=False))
    jumping = tuple(
        replace(state, mag_body=state.mag_body + 0.05 * (-1.0) ** number)
        for number, state in enumerate(logged_states(flight))
    )
    params = complete(flight.parameters.initial, {}, flight.release)
    found = add_noise_by_state(plain.flight, plain.measured[MAG], params, jumping, None)
    assert not found.used
    assert found.table is plain.flight.topics[MAG, 0]
    # a fifth may be without explanation: when more are, those to come are not asked
    assert found.intervals - found.explained <= 0.2 * len(jumping) + 1
    assert found.intervals < 0.5 * len(jumping)


def test_without_states_nothing_is_added(flight):
    topics = {key: table for key, table in flight.topics.items() if key[0] != "estimator_states"}
    led = reconstruct(flight.with_topics(topics))
    assert "noise" not in led.steps[1].what


def test_states_that_cannot_be_read_are_told(flight):
    table = dict(flight.topics["estimator_states", 0])
    for name in ("states[24]", "covariances[22]", "covariances[23]"):
        del table[name]
    table["n_states"] = np.full(len(table["timestamp"]), 24, np.uint8)
    led = reconstruct(flight.with_topics(flight.topics | {("estimator_states", 0): table}))
    assert "without its noise, since the states" in led.steps[1].what
    assert "24 states with 22 variances" in led.steps[1].what
