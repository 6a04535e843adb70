"""How differences vary: against a hand calculation, and what follows from how they were made."""

import numpy as np
import pytest

from fusetune.apply.evidence import AimEvidence, FlightEvidence
from fusetune.apply.power.spread import Spread, spread_of, within_variances


def flight(errors: np.ndarray, name: str = "f") -> FlightEvidence:
    """A flight of one aim and column; errors (S, B) are mean squares of each set in each block, of one sample."""
    count = errors.shape[1]
    aim = AimEvidence("unaided", 1.0, ("x",), np.ones(1), np.ones((count, 1)), errors[:, :, None],
                      np.zeros((*errors.shape, 1)))  # fmt: skip
    return FlightEvidence(name, tuple(f"s{index}" for index in range(len(errors))), (aim,))


def test_the_variance_within_a_flight_is_the_jackknife_of_its_blocks() -> None:
    """Scores ½ ln of the mean with one of three blocks left out, less the present set's: by hand."""
    errors = np.array([[1.0, 1.0, 1.0], [1.0, 2.0, 4.0]])
    left_out = np.array([0.5 * np.log((errors[1].sum() - one) / 2.0) for one in errors[1]])
    wanted = 2.0 / 3.0 * np.square(left_out - left_out.mean()).sum()
    assert within_variances(flight(errors), ["s0", "s1"]) == pytest.approx([0.0, wanted])
    assert within_variances(flight(errors[:, :1]), ["s0", "s1"]) is None


def test_what_blocks_account_for_is_found_as_it_was_made() -> None:
    """Blocks of squared errors of 200 samples each differ by chance alone: all of the variance is within flights; with
    a shift of the logarithm per flight of the same size, half of it."""
    generator = np.random.default_rng(3)

    def study(shift: float) -> Spread:
        flights = []
        for index in range(1500):
            squares = generator.chisquare(200, (3, 10)) / 200
            squares[1:] *= np.exp(2.0 * shift * generator.standard_normal((2, 1)))
            flights.append(flight(squares, f"{index}"))
        found = spread_of(flights, ["s0", "s1", "s2"])
        assert found is not None
        return found

    # ½ ln of a mean of 2000 squares varies by ½/√1000, of two sets by √2 more
    assert study(0.0).within_share == pytest.approx(1.0, abs=0.1)
    half = study(np.sqrt(2.0) * 0.5 / np.sqrt(1000.0))
    assert half.within_share == pytest.approx(0.5, abs=0.1)
    # longer flights lessen the part within: ½ + ½ / 4
    assert half.factor(4.0) == pytest.approx(np.sqrt(0.625), abs=0.04)


def test_twins_and_equal_sets_count_once_or_not_at_all() -> None:
    generator = np.random.default_rng(1)
    flights = []
    for index in range(5):
        own = generator.chisquare(50, (2, 4)) / 50
        flights.append(flight(np.vstack([own[:1], own[:1], own[1:], own[1:]]), f"{index}"))
    found = spread_of(flights, ["s0", "s1", "s2", "s3"])
    assert found is not None
    assert found.differences.shape == (5, 1)
    assert spread_of(flights, ["s0", "s1"]) is None
    assert spread_of(flights[:1], ["s0", "s2"]) is None


def test_a_set_of_the_size_of_those_tried_varies_as_they_do() -> None:
    deviations = np.full(7, 0.05)
    spread = Spread(np.zeros((4, 7)), np.full(7, 0.13), deviations, None)
    assert spread.of_gain(-np.sqrt(0.13**2 - 0.05**2), 5) == pytest.approx(np.full(5, 0.05), rel=1e-6)
    larger = spread.of_gain(-0.3, 5)
    assert (larger > 0.05).all()
    assert (larger < 0.05 * 0.3 / 0.12).all()
    assert spread.factor(3.0) == 1.0
