"""Proposed sets: values by hand, and a file that the design room reads."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.apply.candidates import Candidate, candidates_of_vetoed, without_twins, write_candidates
from fusetune.design.study import load_study
from fusetune.errors import UserError

PRESENT = {
    "EKF2_GPS_V_NOISE": 0.3,
    "EKF2_GPS_P_NOISE": 0.5,
    "EKF2_GPS_V_GATE": 5.0,
    "EKF2_GPS_P_GATE": 5.0,
    "EKF2_ACC_NOISE": 0.35,
    "EKF2_MAG_NOISE": 0.05,
    "EKF2_MAG_GATE": 3.0,
    "EKF2_MAG_TYPE": 0.0,
    "EKF2_GPS_CTRL": 7.0,
}


def proposed(**overrides: float) -> dict[str, dict[str, float]]:
    found = candidates_of_vetoed("bold", overrides, PRESENT, ["11 resets"])
    return {one.name: one.overrides for one in found}


def test_a_smaller_noise_is_proposed_with_a_gate_that_lets_the_same_errors_pass() -> None:
    """√S shrinks at most as R does: a third of the noise at three times the gate has the same reach, 5 · 0.3 m/s."""
    found = proposed(EKF2_GPS_V_NOISE=0.1)
    assert found["bold_wider_gates"] == {"EKF2_GPS_V_NOISE": 0.1, "EKF2_GPS_V_GATE": 15.0}


def test_halfway_is_the_geometric_mean() -> None:
    """√(0.3 · 0.1) = 0.1732, √(0.35 · 0.7) = 0.495; a switch has no middle."""
    found = proposed(EKF2_GPS_V_NOISE=0.1, EKF2_ACC_NOISE=0.7, EKF2_MAG_TYPE=5.0)
    assert found["bold_halfway"] == {"EKF2_GPS_V_NOISE": 0.173, "EKF2_ACC_NOISE": 0.495, "EKF2_MAG_TYPE": 5.0}


def test_gates_are_widened_fourfold_at_most_and_only_where_the_set_has_none_of_its_own() -> None:
    assert proposed(EKF2_MAG_NOISE=0.001)["bold_wider_gates"]["EKF2_MAG_GATE"] == 12.0
    assert "bold_wider_gates" not in proposed(EKF2_MAG_NOISE=0.001, EKF2_MAG_GATE=2.0)
    assert "bold_wider_gates" not in proposed(EKF2_MAG_NOISE=0.1)
    assert "bold_wider_gates" not in proposed(EKF2_ACC_NOISE=0.1)


def test_a_set_of_switches_alone_has_nothing_between() -> None:
    assert proposed(EKF2_MAG_TYPE=5.0, EKF2_GPS_CTRL=5.0) == {}


def test_the_reason_says_what_rules_the_set_out() -> None:
    (one, _) = candidates_of_vetoed("bold", {"EKF2_GPS_V_NOISE": 0.1}, PRESENT, ["11 resets"])
    assert one.reason == (
        "“bold” predicts better than now, but is ruled out (11 resets): its noise, with EKF2_GPS_V_GATE 15"
    )


def test_the_file_is_a_study(tmp_path: Path) -> None:
    candidates = [
        Candidate("a_halfway", {"EKF2_GPS_V_NOISE": 0.173, "EKF2_MAG_TYPE": 5.0}, "because: of “a”, 5 % # better"),
        Candidate("b", {"EKF2_GYR_B_NOISE": 1e-05}, "-"),
    ]
    write_candidates(tmp_path / "candidates.yaml", candidates)
    study = load_study(tmp_path / "candidates.yaml")
    assert (study.name, study.kind) == ("candidates", "list")
    assert [(one.name, one.overrides, one.description) for one in study.sets] == [
        (one.name, one.overrides, one.reason) for one in candidates
    ]
    assert isinstance(study.set_named("a_halfway").overrides["EKF2_MAG_TYPE"], int)


@settings(deadline=None)
@given(
    st.dictionaries(
        st.sampled_from(("EKF2_GPS_V_NOISE", "EKF2_ACC_NOISE", "EKF2_MAG_NOISE")), st.floats(0.01, 0.99), min_size=1
    )
)
def test_whatever_is_proposed_the_design_room_takes(tmp_path_factory, overrides: dict[str, float]) -> None:
    path = tmp_path_factory.mktemp("study") / "candidates.yaml"
    candidates = candidates_of_vetoed("bold", overrides, PRESENT, ["11 resets"])
    write_candidates(path, candidates)
    if candidates:
        assert {one.name: one.overrides for one in load_study(path).sets} == {c.name: c.overrides for c in candidates}


def test_without_candidates_the_file_says_so_and_is_refused_as_a_study(tmp_path: Path) -> None:
    write_candidates(tmp_path / "candidates.yaml", [])
    assert (tmp_path / "candidates.yaml").read_text().startswith("# The decision proposes no sets")
    with pytest.raises(UserError, match="sets"):
        load_study(tmp_path / "candidates.yaml")


def test_twins_are_dropped_and_names_told_apart() -> None:
    def one(name: str, value: float) -> Candidate:
        return Candidate(name, {"EKF2_ACC_NOISE": value}, "")

    compared = {"quiet": {"EKF2_ACC_NOISE": 0.2}}
    kept = without_twins([one("x", 0.2), one("Quiet", 0.3), one("x", 0.3), one("x", 0.4), one("x", 0.5)], compared)
    assert [(c.name, c.overrides["EKF2_ACC_NOISE"]) for c in kept] == [("Quiet_2", 0.3), ("x", 0.4), ("x_2", 0.5)]
