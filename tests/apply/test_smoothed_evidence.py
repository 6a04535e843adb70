"""The weight that aided predictions lack for want of whiteness goes to the smoothed velocity."""

import math

import numpy as np
import pyarrow as pa
import pytest

from fusetune.analyze.scoring.smoothed_scores import SMOOTHED_SCHEMA
from fusetune.apply.evidence import AIDED, SMOOTHED, UNAIDED, BlockSums, FlightEvidence, _smoothed, flight_evidence
from fusetune.apply.settings import DecisionSettings

SETS = ("a", "b")
DEFAULTS = DecisionSettings()


def sums(labels: tuple[str, ...], source: str = "gnss_vel") -> BlockSums:
    n = np.full((2, len(labels)), 10.0)
    nis = np.stack([n, 4.0 * n])
    return BlockSums(SETS, tuple((source, f"{source} {label}") for label in labels), n, nis, np.zeros_like(nis))


AIDED_SUMS, UNAIDED_SUMS = sums(("x", "y", "z")), sums(("x after 9 s", "y after 9 s"), "gnss_pos")


def table(squares: dict[tuple[str, int], float], n: int = 50) -> pa.Table:
    rows = [
        {
            "flight": "f", "set": name, "source": "gnss_vel", "axis": axis, "block": block, "n": n,
            "sum_squares": math.inf, "sum_squares_winsorised": n * value,
        }
        for (name, axis), value in squares.items()
        for block in (0, 1)
    ]  # fmt: skip
    return pa.Table.from_pylist(rows, schema=SMOOTHED_SCHEMA)


VELOCITY = _smoothed(table({("a", axis): 0.04 for axis in range(3)} | {("b", axis): 0.01 for axis in range(3)}))


def weights(white_share: float, settings: DecisionSettings = DEFAULTS, *, unaided: bool = True) -> dict[str, float]:
    found = flight_evidence(
        "f", AIDED_SUMS, UNAIDED_SUMS if unaided else None, {"gnss_vel": white_share}, settings,
        VELOCITY,
    )  # fmt: skip
    assert found is not None
    assert sum(aim.weight for aim in found.aims) == pytest.approx(1.0)
    return {aim.name: aim.weight for aim in found.aims}


def test_where_the_receiver_is_white_it_has_none() -> None:
    """It stays at hand, for it may prove a set better that the score is for as well."""
    assert weights(0.95) == {AIDED: 0.5, UNAIDED: 0.5, SMOOTHED: 0.0}


def test_where_the_receiver_wanders_it_has_what_the_aided_part_would_have() -> None:
    assert weights(0.3) == {UNAIDED: 0.5, SMOOTHED: 0.5}


def test_between_they_share_it() -> None:
    """A white share of 0.75 is half-way between 0.6 and 0.9."""
    found = weights(0.75)
    assert found[AIDED] == pytest.approx(0.25)
    assert found[SMOOTHED] == pytest.approx(0.25)
    assert found[UNAIDED] == pytest.approx(0.5)


def test_its_weight_is_a_setting() -> None:
    assert weights(0.3, DecisionSettings(smoothed_weight=3.0)) == {UNAIDED: 0.25, SMOOTHED: 0.75}
    assert weights(0.3, DecisionSettings(smoothed_weight=0.0)) == {UNAIDED: 1.0}


def test_it_stands_in_before_predictions_that_are_not_trusted() -> None:
    assert weights(0.3, unaided=False) == {SMOOTHED: 1.0}


def evidence_of(settings: DecisionSettings, squares: dict[tuple[str, int], float]) -> FlightEvidence:
    found = flight_evidence("f", None, None, {}, settings, _smoothed(table(squares)))
    assert found is not None
    return found


def test_its_score_is_the_logarithm_of_the_rms_difference() -> None:
    """½ ln 0.04 = ln 0.2 for the one, axes of 0.1, 0.2 and 0.3 m/s for the other."""
    squares = {("a", axis): 0.04 for axis in range(3)}
    squares |= {("b", axis): (0.1 * (axis + 1)) ** 2 for axis in range(3)}
    (aim,) = evidence_of(DEFAULTS, squares).aims
    assert aim.columns == ("gnss_vel x", "gnss_vel y", "gnss_vel z")
    np.testing.assert_allclose(aim.scores, [math.log(0.2), (math.log(0.1) + math.log(0.2) + math.log(0.3)) / 3.0])


def test_axes_have_weights() -> None:
    squares = {("a", axis): (0.1 * (axis + 1)) ** 2 for axis in range(3)}
    (aim,) = evidence_of(DecisionSettings(smoothed_axes={"x": 1.0, "z": 3.0}), squares).aims
    np.testing.assert_allclose(aim.scores, [0.25 * math.log(0.1) + 0.75 * math.log(0.3)])


def test_a_flight_without_a_source_of_velocity_has_no_such_aim() -> None:
    assert _smoothed(SMOOTHED_SCHEMA.empty_table()) is None
