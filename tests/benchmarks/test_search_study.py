"""The study of the search: the truth as its ground, emulated flights, and what the decision makes of both."""

from __future__ import annotations

import numpy as np
import pytest

from fusetune.apply.evidence import AIDED, AIMS, SMOOTHED, UNAIDED
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.settings import DecisionSettings
from fusetune.design.factors import Factor

pytestmark = pytest.mark.usefixtures("benchmarks")

FACTOR = Factor("EKF2_ACC_NOISE", "log", 0.0875, 1.4, 0.35, 2.0)
WEIGHTS = {AIDED: 0.3, UNAIDED: 0.5, SMOOTHED: 0.2}


def parabolas(coordinates: np.ndarray, flights: int) -> dict[str, np.ndarray]:
    """(N, F) of each kind of prediction: smooth, 0 at the present value, other on each flight."""
    steeper = 1.0 + 0.2 * np.arange(flights)
    return {aim: 0.02 * (place + 1) * np.outer(coordinates**2, steeper) for place, aim in enumerate(AIMS)}


@pytest.fixture
def table():
    from benchmarks.search_study.emulated import tried_table

    coordinates = np.array([-2.0, -1.5, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0])
    aims = parabolas(coordinates, 4)
    score = sum(WEIGHTS[aim] * values for aim, values in aims.items())
    objections = tuple(("vetoed",) if one > 1.2 else () for one in coordinates)
    sets = [{"EKF2_ACC_NOISE": FACTOR.origin * 2.0**one} for one in coordinates]
    return tried_table([FACTOR], sets, Comparison(score, aims, objections))


def test_the_truth_is_compared_by_velocity_and_drift() -> None:
    """Half the logarithms of 0.8 in velocity and 0.5 in drift; what attitude and position do does not count."""
    from benchmarks.search_study.truth_ground import compared_by_truth

    base = np.array([[0.1, 1.0, 0.5, 2.0]])
    compared = compared_by_truth(np.array([[[0.08, 9.0, 9.0, 1.0]]]), base)
    assert compared.differences == pytest.approx(0.5 * np.log(0.8 * 0.5))
    assert compared.aims[AIDED] == pytest.approx(np.log(0.8))
    assert compared.aims[UNAIDED] == pytest.approx(np.log(0.5))


def test_a_flight_without_gaps_is_compared_by_velocity_and_a_set_that_diverged_has_no_score() -> None:
    from benchmarks.search_study.truth_ground import compared_by_truth

    base = np.array([[0.1, 1.0, 0.5, np.nan]])
    figures = np.array([[[0.05, 1.0, 0.5, np.nan]], [[np.nan] * 4]])
    compared = compared_by_truth(figures, base)
    assert compared.differences[:, 0] == pytest.approx([np.log(0.5), np.nan], nan_ok=True)


def test_a_table_has_the_weights_of_the_kinds_of_prediction(table) -> None:
    # of kinds that are alike in shape only the sum is determined
    total = sum(table.weights[aim] * table.aims[aim] for aim in AIMS)
    expected = sum(WEIGHTS[aim] * values for aim, values in parabolas(table.coordinates[:, 0], 4).items())
    assert total == pytest.approx(expected)


def test_emulated_flights_agree_with_what_was_tried_and_lie_between(table) -> None:
    from benchmarks.search_study.emulated import Emulator

    emulator = Emulator(table)
    between = np.array([[-1.25], [0.75]])
    for aim in AIMS:
        assert emulator.aims(table.coordinates)[aim] == pytest.approx(table.aims[aim], abs=1e-3)
        assert emulator.aims(between)[aim] == pytest.approx(parabolas(between[:, 0], 4)[aim], abs=2e-3)
    assert emulator.objected(np.array([[0.1], [1.9]])).tolist() == [False, True]


def test_with_noise_only_no_set_is_better_on_all_flights_together(table) -> None:
    from benchmarks.search_study.emulated import EmulatedGround, Emulator

    from fusetune.apply.search.requests import values_of

    ground = EmulatedGround(Emulator(table), np.ones(4))
    score, _ = ground.differences(
        values_of({"EKF2_ACC_NOISE": 0.35}), [values_of({"EKF2_ACC_NOISE": one}) for one in (0.2, 0.9)]
    )
    # the kinds of prediction weigh alike on these flights
    assert score.mean(axis=1) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert np.abs(score).max() > 0.003


@pytest.mark.parametrize(("gain", "changes"), [(-0.2, True), (0.0, False), (0.2, False)])
def test_the_decision_follows_the_flights_that_were_kept_aside(gain: float, changes: bool) -> None:
    from benchmarks.search_study.decided import decided

    luck = np.array([0.01, -0.01, 0.005, -0.005, 0.0, 0.02, -0.02, 0.0])
    one = decided(
        dict.fromkeys(WEIGHTS, gain + luck),
        {aim: np.full(8, weight) for aim, weight in WEIGHTS.items()},
        DecisionSettings(draws=200),
    )
    assert one.changes is changes
    assert one.found.difference == pytest.approx(gain, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "found", "right", "near"),
    [
        ("EKF2_GPS_DELAY", 50.0, 40.0, True),
        ("EKF2_GPS_DELAY", 60.0, 40.0, False),
        ("EKF2_GPS_POS_X", -0.11, -0.2, True),
        ("EKF2_GPS_POS_X", 0.0, -0.2, False),
        ("EKF2_ACC_NOISE", 0.5, 0.35, True),
        ("EKF2_ACC_NOISE", 0.2, 0.35, False),
    ],
)
def test_how_near_is_near(name: str, found: float, right: float, near: bool) -> None:
    from benchmarks.search_study.tables import is_near

    assert is_near(name, found, right) is near


def test_an_antenna_beside_the_imu_moves_as_a_rigid_body_does() -> None:
    """v + ω × r, with ω from the gyro's own law: attitude' = attitude ω×."""
    from benchmarks.decision_study.second_simulator.chance import streams
    from benchmarks.decision_study.second_simulator.path import fly_path
    from benchmarks.decision_study.second_simulator.truth import STEP_S, true_motion

    truth = true_motion(fly_path("aggressive", 20.0, STEP_S, streams(3)["path"]), np.zeros(3))
    arm = np.array([-0.2, 0.1, -0.3])
    there = truth.beside(arm)
    at = slice(20_000, 30_000)
    turned = (truth.attitude[19_999:29_999].inv() * truth.attitude[20_001:30_001]).as_rotvec() / (2.0 * STEP_S)
    added = truth.attitude[at].apply(np.cross(turned, arm))
    assert np.linalg.norm(there.position - truth.position, axis=1) == pytest.approx(np.linalg.norm(arm))
    assert there.velocity[at] - truth.velocity[at] == pytest.approx(added, abs=1e-4)
    assert np.abs(added).max() > 0.1
