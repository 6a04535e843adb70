"""What a pilot reads of the sensitivity, and that the file keeps it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.apply.sensitivity.made_trials import drawn, made_trials

from fusetune.apply.sensitivity.files import NOTHING_TOLD, read_sensitivity, write_sensitivity
from fusetune.apply.sensitivity.result import Sensitivity
from fusetune.apply.sensitivity.sensitivity import sensitivity
from fusetune.apply.sensitivity.wording import sentences
from fusetune.errors import UserError

SLOPES = (0.030, 0.035, 0.045, 0.032, 0.040, 0.038)


@pytest.fixture(scope="module")
def told() -> Sensitivity:
    """The first parameter has an optimum, the second goes on to the end, the third does nothing."""
    flights = [lambda at, s=s: s * at[:, 0] ** 2 - 0.02 * at[:, 1] + 0.0003 * at[:, 2] for s in SLOPES]
    return sensitivity(made_trials(drawn(60, 3), flights))


def test_the_answer_comes_first(told: Sensitivity) -> None:
    first, flat, bound, trust = sentences(told)
    # 0.0367 nat at a factor of two is 3.7 %
    assert first == (
        "On these flights EKF2_GPS_V_NOISE and EKF2_ACC_NOISE matter, most of all EKF2_GPS_V_NOISE (errors change by "
        "up to 3.7 %)."
    )
    # what was tried of it: the lowest and highest of the drawn values
    assert flat == (
        "Could be anything in this range: EKF2_BARO_NOISE between 0.04 and 2.2 (the errors change by less than 1 % "
        "there, or by less than one standard error)."
    )
    assert bound.startswith("The best lies at the end of what was tried for EKF2_ACC_NOISE at 2.")
    assert trust.startswith("A set that was left out is predicted to within 0.")


def test_sets_that_change_all_together_tell_nothing() -> None:
    steps = np.array([-1.5, 0.5, 1.0, 2.0])
    trials = made_trials(np.column_stack([steps, 1.1 * steps]), [lambda at: 0.02 * at[:, 0]] * 3)
    (only,) = sentences(sensitivity(trials))
    assert only == (
        "Which parameter matters cannot be told: 4 different sets beside the present one change EKF2_GPS_V_NOISE and "
        "EKF2_ACC_NOISE together, so that what one does is not seen apart from what the others do. A study that "
        "changes one at a time would tell."
    )


def test_one_at_a_time_says_that_it_sees_no_interaction() -> None:
    coordinates = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    trials = made_trials(coordinates, [lambda at, s=s: s * at[:, 0] ** 2 for s in SLOPES])
    told = sentences(sensitivity(trials))
    assert told[0] == "On these flights EKF2_GPS_V_NOISE matters (errors change by up to 3.7 %)."
    assert told[-1] == (
        "From 4 sets each curve is a parabola through what was tried. How parameters act together is not seen."
    )


def test_a_surface_that_predicts_nothing_is_not_trusted() -> None:
    noise = np.random.default_rng(3).normal(0.0, 0.02, 30)
    told = sentences(sensitivity(made_trials(drawn(30, 2), [lambda at: noise] * 3)))
    assert "little better than the mean of the others, so take the curves for a rough picture." in told[-1]


def test_the_file_keeps_what_was_told(told: Sensitivity, tmp_path: Path) -> None:
    path = tmp_path / "sensitivity.json"
    write_sensitivity(path, told)
    kept = read_sensitivity(path)
    assert kept.sentences == sentences(told)
    assert kept.found is not None
    assert [one.verdict for one in kept.found.parameters] == [one.verdict for one in told.parameters]
    one, other = kept.found.parameters[0].curve, told.parameters[0].curve
    assert one is not None
    assert other is not None
    assert one.upper == pytest.approx(other.upper, rel=1e-4, abs=1e-9)
    # what is read is written again byte by byte
    write_sensitivity(tmp_path / "again.json", replace(kept.found, confidence=kept.found.confidence))
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_the_file_of_nothing_says_so(tmp_path: Path) -> None:
    write_sensitivity(tmp_path / "sensitivity.json", None)
    assert read_sensitivity(tmp_path / "sensitivity.json") == NOTHING_TOLD
    with pytest.raises(UserError, match="cannot be read"):
        read_sensitivity(tmp_path / "other.json")
