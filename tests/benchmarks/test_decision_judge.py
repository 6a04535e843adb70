"""The judge, the made studies of equal sets and the rule of 0.1, on numbers that are checked by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fusetune.apply.evidence import AimEvidence, FlightEvidence
from fusetune.apply.settings import DecisionSettings

NAMES = ("present", "one", "two")


pytestmark = pytest.mark.usefixtures("benchmarks")


def world(errors: dict[str, list[float]], **more):
    """A world of one flight whose true errors are given in the order of `NAMES`."""
    from benchmarks.decision_study.world import World

    truth = {name: np.array([values]) for name, values in errors.items()}
    usual = {
        "overrides": {name: {} for name in NAMES},
        "settings": DecisionSettings(),
        "vetoed": {},
        "old_vetoed": {},
        "figures": {},
    }
    return World(
        name="made", sets=NAMES, folders=(), flights=(), delays=(), old_flights=(), truth=truth, **(usual | more)
    )


def verdict(chosen: int, **errors: list[float]):
    from benchmarks.decision_study.judge import judge

    return judge(world(errors), "both", range(3), "some rule", chosen)


def test_a_choice_near_the_best_passes() -> None:
    one = verdict(0, velocity=[1.04, 1.0, 2.0], attitude=[1.0, 1.0, 2.0], position=[1, 1.1, 2], drift=[1, 1, 2])
    assert one.regret == pytest.approx({"velocity": 0.04, "attitude": 0.0, "position": 0.0, "drift": 0.0})
    assert one.is_near
    assert one.passes
    assert not one.is_worst


def test_a_choice_that_another_beats_in_one_and_hardly_loses_to_in_others_fails() -> None:
    # "one" is 10 % better in velocity and 1 % worse in drift: on the old front, not on the stricter one.
    one = verdict(0, velocity=[1.1, 1.0, 2.0], attitude=[1, 1, 2], position=[1, 1, 2], drift=[1.0, 1.01, 2.0])
    assert one.on_old_front
    assert one.passes_as_before
    assert one.beaten_by == ("one",)
    assert not one.passes


def test_a_choice_that_pays_for_its_weakness_is_on_the_front() -> None:
    # "one" is 10 % better in velocity and 3 % worse in drift.
    one = verdict(0, velocity=[1.1, 1.0, 2.0], attitude=[1, 1, 2], position=[1, 1, 2], drift=[1.0, 1.03, 2.0])
    assert one.beaten_by == ()
    assert one.passes
    assert not one.is_near


def test_the_worst_set_never_passes_by_the_front() -> None:
    # Best in drift alone, and worst in the mean of the logarithms.
    one = verdict(2, velocity=[1, 1, 2], attitude=[1, 1, 2], position=[1, 1, 2], drift=[1.0, 1.0, 0.9])
    assert one.beaten_by == ()
    assert one.is_worst
    assert not one.passes
    assert one.worst_in == ("velocity", "attitude", "position")


def test_harm_is_told_against_the_present_set() -> None:
    one = verdict(1, velocity=[1.0, 0.5, 2.0], attitude=[1, 1.08, 2], position=[1, 1.04, 2], drift=[1, 1, 2])
    assert one.harm == pytest.approx({"attitude": 0.08})


def test_gains_are_those_of_the_errors() -> None:
    from benchmarks.decision_study.judge import gains

    made = world({"velocity": [2, 1, 2], "attitude": [1, 1, 1], "position": [1, 1, 1], "drift": [8, 1, 8]})
    found = gains(made, range(3))
    assert found["velocity"] == pytest.approx([0.0, 0.5, 0.0])
    # The geometric mean of the ratios 1/2, 1, 1, 1/8 is 1/2.
    assert found["all four"] == pytest.approx([0.0, 0.5, 0.0])


def test_power_counts_the_studies_in_which_so_much_can_be_gained() -> None:
    from benchmarks.decision_study.drawn import DrawnStudy, power

    def study(possible: float, gained: float, flights: int = 5):
        return DrawnStudy(
            "made", "both", "r", flights, True, True, 0.0, False, False, {"velocity": possible}, {"velocity": gained}
        )

    drawn = [study(0.3, 0.25), study(0.3, 0.0), study(0.15, 0.15), study(0.3, 0.3, flights=8)]
    assert power(drawn, 5, 0.2, "velocity") == (0.5, 2)
    assert power(drawn, 5, 0.1, "velocity") == (pytest.approx(2 / 3), 3)
    assert math.isnan(power(drawn, 3, 0.1, "velocity")[0])


def flight(number: int, differences: dict[str, float], weights: tuple[float, float] = (0.5, 0.5)) -> FlightEvidence:
    """Evidence of two aims, two blocks of two samples each; scores differ by what is given, alike in both."""
    generator = np.random.default_rng(number)
    aims = []
    for name, weight in zip(("aided", "unaided"), weights, strict=True):
        base = generator.uniform(1.0, 2.0, (1, 2, 1))
        factors = np.exp([2.0 * differences.get(one, 0.0) for one in NAMES])
        nis = base * factors[:, None, None]
        aims.append(AimEvidence(name, weight, ("v",), np.ones(1), np.full((2, 1), 2.0), nis, np.zeros_like(nis)))
    return FlightEvidence(f"{number}", NAMES, tuple(aims))


def differences(flights) -> np.ndarray:
    """(F, S) to the present set."""
    rows = [[one.scores[one.sets.index(name)] for name in NAMES] for one in flights]
    return np.array(rows) - np.array(rows)[:, :1]


def test_means_are_moved_and_the_spread_stays() -> None:
    from benchmarks.decision_study.nulls import with_means

    found = [-0.3, -0.1, 0.0, 0.2]
    flights = [flight(number, {"one": value, "two": -value}) for number, value in enumerate(found)]
    moved = differences(with_means(flights, 0.005))
    mean = np.mean(found)
    # By name in turn: "one" is better by 0.5 %, "two" worse.
    assert moved[:, 1] == pytest.approx(np.array(found) - mean - 0.005)
    assert moved[:, 2] == pytest.approx(mean - np.array(found) + 0.005)


def test_means_of_flights_that_weigh_the_aims_otherwise() -> None:
    from benchmarks.decision_study.nulls import with_means

    flights = [flight(0, {"one": -0.2}, (0.2, 0.8)), flight(1, {"one": 0.3}, (0.7, 0.3)), flight(2, {"one": 0.1})]
    assert differences(with_means(flights, 0.0)).mean(axis=0) == pytest.approx(0.0, abs=1e-12)


def test_mirrored_sets_are_worse_by_what_they_were_better() -> None:
    from benchmarks.decision_study.nulls import mirrored

    flights = [flight(0, {"one": -0.3, "two": 0.1}), None]
    turned = mirrored(flights)
    assert turned[1] is None
    assert differences(turned[:1])[0] == pytest.approx([0.0, 0.3, -0.1])


def test_sets_of_either_sign_are_worth_what_the_others_are_or_the_opposite() -> None:
    from benchmarks.decision_study.nulls import mirrored, of_either_sign

    one = flight(0, {"one": -0.3, "two": 0.1})
    turned = mirrored([one])[0]
    generator = np.random.default_rng(0)
    made = differences([of_either_sign(one, turned, generator) for _ in range(200)])
    assert made[:, 0] == pytest.approx(0.0)
    assert set(made[:, 1:].round(9).ravel()) == {-0.3, 0.3, -0.1, 0.1}
    # Each of them is drawn once in four times: 400 draws, standard deviation 8.7.
    assert np.count_nonzero(made[:, 1:].round(9) == 0.3) == pytest.approx(100, abs=35)


def test_blocks_drawn_anew_are_the_present_sets() -> None:
    from benchmarks.decision_study.nulls import blocks_redrawn

    original = flight(0, {"one": 5.0, "two": -5.0})
    redrawn = blocks_redrawn([original], np.random.default_rng(1))[0]
    for before, after in zip(original.aims, redrawn.aims, strict=True):
        assert set(after.sum_nis.ravel().round(12)) <= set(before.sum_nis[0].ravel().round(12))


def old_choice(values: list[dict[str, float]], distances: dict[str, float] | None = None, vetoed=None) -> str:
    from benchmarks.decision_study.old_rule import OldRule

    flights = [flight(number, one) for number, one in enumerate(values)]
    usual = {"present": 0.0, "one": 1.0, "two": 1.0}
    return OldRule().choose(flights, NAMES, vetoed or {}, distances or usual)


def test_the_old_rule_needs_five_flights_that_agree() -> None:
    # With F flights that agree, the flips that are as extreme are 1 of 2^F: 1/16 > 5 %, 1/32 < 5 %.
    agreeing = [{"one": -0.1 - 0.01 * number} for number in range(5)]
    assert old_choice(agreeing[:4]) == "present"
    assert old_choice(agreeing) == "one"
    assert old_choice(agreeing, vetoed={"one": "resets"}) == "present"


def test_the_old_rule_prefers_the_small_even_gain() -> None:
    # What was to be mended: "one" gains 60 % on some flights and is not proved, "two" gains 1 % evenly and is chosen.
    large = [-1.0, -0.9, -0.02, 0.05, 0.03, -0.8, 0.02, -0.7]
    values = [{"one": value, "two": -0.01 - 0.0005 * number} for number, value in enumerate(large)]
    assert old_choice(values) == "two"


def test_the_old_rule_takes_the_nearest_of_equal_sets() -> None:
    values = [{"one": -0.200 - 0.01 * number, "two": -0.199 - 0.0101 * number} for number in range(6)]
    assert old_choice(values, {"present": 0.0, "one": 2.0, "two": 1.0}) in ("one", "two")
    even = [{"one": -0.2 - 0.01 * number, "two": -0.2 - 0.01 * number} for number in range(6)]
    assert old_choice(even, {"present": 0.0, "one": 2.0, "two": 1.0}) == "two"
