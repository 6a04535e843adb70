"""Against scipy's Riccati equation, against a recursion written out step by step, and against what follows by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm, solve_discrete_are

from fusetune.design.covariance.linear_covariance import (
    NoSteadyStateError,
    covariance_before_correction,
    recursion_of,
    transition,
)
from fusetune.design.covariance.linear_model import LinearModel, LinearSensor, State
from fusetune.design.covariance.riccati_map import RiccatiMap

A = np.array([[0.0, 1.0, 0.0], [0.0, -0.2, 1.0], [0.0, 0.0, -0.05]])
NOISE = np.diag([0.0, 0.3, 0.01])
POSITION, SPEED = np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 1.0]])


def model_of(sensors: dict[str, LinearSensor], step_rate_hz: float = 100.0, is_exact: bool = True) -> LinearModel:
    states = tuple(State(name) for name in ("p", "v", "a"))
    return LinearModel(states, A, step_rate_hz, {"force": NOISE}, sensors, np.eye(3), is_exact=is_exact)


def corrected(P: np.ndarray, sensor: LinearSensor) -> np.ndarray:
    """The update as textbooks have it."""
    S = sensor.H @ P @ sensor.H.T + sensor.R
    return P - P @ sensor.H.T @ np.linalg.solve(S, sensor.H @ P)


@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(1, 3))
@settings(max_examples=40, deadline=None)
def test_a_synchronous_system_has_the_covariance_of_the_riccati_equation(seed: int, n: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    F, H = rng.normal(size=(n, n)), rng.normal(size=(m, n))
    F /= max(1.0, np.abs(np.linalg.eigvals(F)).max() / 0.98)
    root_q, root_r = rng.normal(size=(n, n)), rng.normal(size=(m, m))
    Q, R = root_q @ root_q.T + 0.01 * np.eye(n), root_r @ root_r.T + 0.1 * np.eye(m)
    model = LinearModel(
        tuple(State(str(i)) for i in range(n)), F, 10.0, {"w": Q}, {"y": LinearSensor(H, R, 10.0)}, np.eye(n), True
    )
    P = solve_discrete_are(F.T, H.T, Q, R)
    assert np.abs(covariance_before_correction(model, "y") - P).max() <= 1e-9 * np.abs(P).max()


def test_several_sensors_at_their_own_times_are_as_a_recursion_step_by_step() -> None:
    """At 5 Hz and 3 Hz, the second 70 ms later; between two events the state moves on by that time."""
    first = LinearSensor(POSITION, np.array([[0.04]]), 5.0)
    second = LinearSensor(SPEED, np.diag([0.1, 0.2]), 3.0, phase_s=0.07)
    found = covariance_before_correction(model_of({"first": first, "second": second}), "second")
    events = sorted(
        [(k / 5.0, first) for k in range(1, 3001)] + [(0.07 + k / 3.0, second) for k in range(1800)],
        key=lambda event: event[0],
    )
    P, now, before = np.eye(3), 0.0, []
    for at, sensor in events:
        F, Q = transition(model_of({}), at - now)
        P, now = F @ P @ F.T + Q, at
        if sensor is second:
            before.append(P)
        P = corrected(P, sensor)
    assert found == pytest.approx(np.mean(before[-3:], axis=0), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("delay_s", [0.03, 0.1, 0.2, 0.45])
def test_a_late_measurement_leaves_what_was_known_before_it_and_the_time_since(delay_s: float) -> None:
    """All that came before is in; so just before z(t) arrives, P is that before z(t) at t, moved on by the delay.

    Follows by hand for one sensor of any delay, if what is late is used as well as it can be.
    """
    sensor = LinearSensor(POSITION, np.array([[0.04]]), 10.0)
    at_once = covariance_before_correction(model_of({"y": sensor}), "y")
    late = LinearSensor(POSITION, np.array([[0.04]]), 10.0, delay_s=delay_s)
    F, Q = transition(model_of({}), delay_s)
    found = covariance_before_correction(model_of({"y": late}), "y")
    assert found == pytest.approx(F @ at_once @ F.T + Q, rel=1e-8, abs=1e-12)


def test_at_the_same_instant_p_is_told_before_all_corrections() -> None:
    first, second = LinearSensor(POSITION, np.array([[0.04]]), 5.0), LinearSensor(SPEED, np.diag([0.1, 0.2]), 5.0)
    model = model_of({"first": first, "second": second})
    before = [covariance_before_correction(model, name) for name in ("first", "second")]
    assert before[0] == pytest.approx(before[1], rel=1e-12)
    joined = solve_discrete_are(
        expm(A * 0.2).T,
        np.vstack([POSITION, SPEED]).T,
        transition(model, 0.2)[1],
        np.diag([0.04, 0.1, 0.2]),
    )
    assert before[0] == pytest.approx(joined, rel=1e-9)


def test_over_time_it_is_the_recursion_from_the_start() -> None:
    sensor = LinearSensor(POSITION, np.array([[0.04]]), 5.0)
    model = model_of({"y": sensor}, is_exact=False)
    P = np.eye(3)
    for _ in range(7):
        for _ in range(20):
            P = (np.eye(3) + A / 100.0) @ P @ (np.eye(3) + A / 100.0).T + NOISE / 100.0
        before, P = P, corrected(P, sensor)
    assert covariance_before_correction(model, "y", duration_s=1.4) == pytest.approx(before, rel=1e-11)
    steady = covariance_before_correction(model, "y")
    assert covariance_before_correction(model, "y", duration_s=2000.0) == pytest.approx(steady, rel=1e-9)


def test_what_no_sensor_tells_of_has_no_steady_state() -> None:
    with pytest.raises(NoSteadyStateError):
        covariance_before_correction(model_of({"v": LinearSensor(SPEED[:1], np.array([[0.1]]), 5.0)}), "v")
    odd = {"a": LinearSensor(POSITION, np.eye(1), 99.9), "b": LinearSensor(POSITION, np.eye(1), 100.1)}
    assert recursion_of(model_of(odd)).period_s == pytest.approx(10.0)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_maps_in_a_row_are_one_map(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3))
    maps = [
        RiccatiMap.propagation(rng.normal(size=(3, 3)), root @ root.T),
        RiccatiMap.correction(rng.normal(size=(2, 3)), np.diag(rng.uniform(0.1, 2.0, 2))),
        RiccatiMap.propagation(rng.normal(size=(3, 3)), np.eye(3)),
        RiccatiMap.correction(rng.normal(size=(1, 3)), np.eye(1)),
    ]
    whole = maps[0].then(maps[1]).then(maps[2].then(maps[3]))
    start = rng.normal(size=(3, 3))
    P = expected = start @ start.T
    for _ in range(3):
        for one in maps:
            expected = one(expected)
    assert whole.repeated(3)(P) == pytest.approx(expected, rel=1e-7, abs=1e-9)
