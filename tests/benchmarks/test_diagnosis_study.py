"""The study of the diagnosis: what is injected, and how what was said of it is counted."""

from __future__ import annotations

from collections.abc import Sequence

import benchmarks.diagnosis_study.__main__ as study
import numpy as np
import pytest
from benchmarks.diagnosis_study.cases import CALM, HEALTHY, PAIRS, airborne_s, case_of
from benchmarks.diagnosis_study.estimates import QUANTITIES, compared, estimates_table
from benchmarks.diagnosis_study.kinds import KINDS
from benchmarks.diagnosis_study.reliability_fit import cross_validated, fitted_curve
from benchmarks.diagnosis_study.tables import (
    confusion_table,
    healthy_table,
    pairs_table,
    reliability_table,
    shares_table,
    study_tables,
)
from benchmarks.diagnosis_study.verdicts import Named, Told, Verdict

from fusetune.execute.parameters import flown_parameters
from fusetune.execute.sensors.faults import ToldWrong, of_kind


@pytest.mark.parametrize("group", [*KINDS, HEALTHY, CALM, PAIRS])
def test_cases_are_drawn_again_alike_can_be_flown_and_are_short(group: str) -> None:
    for number in range(6):
        case, again = case_of(group, number), case_of(group, number)
        assert case == again
        told = {fault.parameter: fault.value for fault in of_kind(case.faults, ToldWrong)}
        flown_parameters(case.vehicle, told, default_profile=False)
        assert 45.0 < airborne_s(case) < 80.0
        assert len(case.injected) == {HEALTHY: 0, CALM: 0, PAIRS: 2}.get(group, 1)


@pytest.mark.parametrize("group", [kind for kind in KINDS if kind != "magnetometer_rotated"])
def test_magnitudes_go_from_barely_visible_to_gross(group: str) -> None:
    visible = [case_of(group, number).injected[0].is_visible for number in range(40)]
    assert 0.2 < np.mean(visible) < 1.0


def test_a_vehicle_is_told_what_is_true_but_for_what_is_injected() -> None:
    for number in range(10):
        case = case_of("gnss_delay", number)
        right, document = case.truth(), case.document()
        differing = {name for name, value in document["told"].items() if abs(right.get(name, value) - value) > 6e-4}
        assert differing == {"EKF2_GPS_DELAY"}
        wrong = abs(document["told"]["EKF2_GPS_DELAY"] - right["EKF2_GPS_DELAY"])
        assert wrong == pytest.approx(document["magnitude"], abs=0.51)


def test_two_faults_of_a_pair_are_of_different_groups_and_both_visible() -> None:
    for number in range(20):
        first, second = case_of(PAIRS, number).injected
        assert KINDS[first.kind].group != KINDS[second.kind].group
        assert first.is_visible
        assert second.is_visible


def verdict(
    group: str, named: Sequence[str], *, visible: bool = True, severity: str = "warning", told: Sequence[Told] = ()
) -> Verdict:
    kinds = {HEALTHY: [], CALM: [], PAIRS: ["gnss_glitch", "vibration"]}.get(group, [group])
    truth = {
        "EKF2_MCOEF": 0.25, "EKF2_GND_EFF_DZ": 2.0,
        "motor_field_x_gauss_per_a": 0.003, "motor_field_y_gauss_per_a": 0.0, "motor_field_z_gauss_per_a": 0.004,
        "motor_field_x_gauss_per_throttle": 0.12, "motor_field_y_gauss_per_throttle": 0.0,
        "motor_field_z_gauss_per_throttle": 0.16,
    }  # fmt: skip
    fault = {"visible": visible, "injected": [{"kind": kind} for kind in kinds], "truth": truth}
    causes = tuple(Named(name, severity, 0.9, 1.0, {}) for name in named)
    return Verdict(group, 0, fault, causes, tuple(told), (), 0.2)


def test_first_and_among_the_first_two_are_counted_of_visible_faults() -> None:
    said = [
        verdict("gnss_glitch", ["gnss_glitch"]),
        verdict("gnss_glitch", ["gnss_accuracy", "gnss_glitch"]),
        verdict("gnss_glitch", ["gnss_accuracy", "vibration", "gnss_glitch"]),
        verdict("gnss_glitch", []),
        verdict("gnss_glitch", [], visible=False),
        verdict("gnss_glitch", ["gnss_glitch"], visible=False),
    ]
    # of four visible ones, one stands first and one second
    assert "| `gnss_glitch` | 6 | 1 of 4 (25.0 %) | 2 of 4 (50.0 %) | 1 of 2 (50.0 %) |" in shares_table(said)
    assert "| `gnss_glitch` | gnss_accuracy 2, gnss_glitch 1, nothing 1 |" in confusion_table(said)


def test_alarms_on_healthy_flights_are_warnings_and_failures() -> None:
    said = [
        verdict(HEALTHY, []),
        verdict(HEALTHY, ["baro_drift"], severity="note"),
        verdict(HEALTHY, ["baro_drift"], severity="fail"),
        verdict(HEALTHY, []),
    ]
    assert "| 4 | 1 | 25.0 % | baro_drift 1 |" in healthy_table(said)


def test_a_pair_counts_when_both_are_named() -> None:
    said = [
        verdict(PAIRS, ["vibration", "gnss_glitch"]),
        verdict(PAIRS, ["vibration"]),
        verdict(PAIRS, ["baro_drift"]),
        verdict(PAIRS, ["gnss_glitch", "baro_drift", "vibration"]),
    ]
    table = pairs_table(said)
    assert "| 4 | 2 of 4 (50.0 %) | 1 of 4 (25.0 %) |" in table
    assert "gnss_glitch 2, vibration 1" in table


def test_tables_of_flights_in_view_have_places_of_their_own() -> None:
    said = [verdict("gnss_glitch", ["gnss_glitch"])]
    fresh, in_view = study_tables(said, None), study_tables(said, None, fresh=False)
    assert not set(fresh) & set(in_view)
    assert "estimates" not in fresh
    assert in_view["confusion_in_view"] == fresh["confusion"]
    document = study.DOCUMENT.read_text(encoding="utf-8")
    assert all(f"<!-- {name} -->" in document for name in [*fresh, *in_view])


def test_a_diagnosis_counts_by_how_sure_it_was_and_is_right_where_that_was_injected() -> None:
    # each at 0.9: two of glitches, one of them wrongly of vibration, and one of a healthy flight
    said = [
        verdict("gnss_glitch", ["gnss_glitch", "vibration"]),
        verdict("gnss_glitch", ["gnss_glitch"], visible=False),
    ]
    rows = reliability_table([*said, verdict(HEALTHY, ["baro_drift"])]).splitlines()
    assert rows[2:] == ["| 0.85 to 0.92 | 4 | 90.0 % | 50.0 % |"]


def test_the_curve_of_how_sure_finds_shares_that_were_put_in() -> None:
    rng = np.random.default_rng(2)
    said = rng.uniform(0.3, 0.97, 4000)
    right = (rng.random(said.size) < 1.0 / (1.0 + np.exp(-(0.5 + 1.5 * np.log(said / (1.0 - said)))))).astype(float)
    assert fitted_curve(said, right) == pytest.approx((0.5, 1.5), abs=0.15)
    fold = np.arange(said.size) % 5
    told = cross_validated(said, right, fold)
    sure = told > 0.8
    assert right[sure].mean() == pytest.approx(told[sure].mean(), abs=0.02)
    # with nothing known it is what signs say
    assert fitted_curve(np.zeros(0), np.zeros(0)) == pytest.approx((0.0, 1.0), abs=1e-3)


def test_fresh_flights_are_none_of_those_that_levels_were_set_with(monkeypatch: pytest.MonkeyPatch) -> None:
    few = ["study", "--fresh", "--kinds", "vibration", "--seeds", "2", "--healthy", "1", "--calm", "1", "--pairs", "1"]
    monkeypatch.setattr("sys.argv", few)
    options = study._options()
    drawn = [(case.group, case.number) for case in study._cases(options)]
    assert sorted(drawn) == [(CALM, 20), (HEALTHY, 200), (PAIRS, 50), ("vibration", 20), ("vibration", 21)]
    monkeypatch.setattr("sys.argv", ["study"])
    usual = study._options()
    assert (usual.seeds, usual.healthy, usual.calm, usual.pairs) == (20, 200, 20, 50)


def test_estimates_are_compared_with_the_truth_in_their_own_unit() -> None:
    by_name = {quantity.name: quantity for quantity in QUANTITIES}
    drag = verdict(CALM, [], told=[Told("drag", "EKF2_MCOEF", "1/s", 0.26, 0.24, 0.28)])
    found, asked = compared(by_name["BCOEF, flown for it in calm air"], [drag])
    assert (found, asked) == ([], 1)
    momentum = next(one for one in QUANTITIES if one.holds("EKF2_MCOEF") and CALM in one.groups)
    found, asked = compared(momentum, [drag])
    assert asked == 1
    assert (found[0].error, found[0].covers) == (pytest.approx(0.04), 1.0)
    # PX4 is to be told the dip and a tenth: 2.2 m, and its interval lies above
    dip = verdict("baro_ground_effect", [], told=[Told("ground_effect", "EKF2_GND_EFF_DZ", "m", 2.6, 2.3, 2.9)])
    found, _ = compared(by_name["ground effect"], [dip])
    assert (found[0].error, found[0].covers) == (pytest.approx(0.4 / 2.2), 0.0)
    # a vector's errors are over its length: 5 Gauss per kA, of which half a Gauss along x is a tenth
    motor = verdict("motor_magnetic_field", [], told=[Told("motor", "motor_field_x", "G/kA", 3.5, 2.9, 4.1)])
    found, _ = compared(by_name["motor field"], [motor])
    assert (found[0].error, found[0].covers) == (pytest.approx(0.1), 1.0)
    # what cannot be seen is not judged
    hidden = verdict("baro_ground_effect", [], visible=False, told=dip.told)
    assert compared(by_name["ground effect"], [hidden]) == ([], 0)
    assert "| MCOEF, likewise | 1 | 1 | 4 % | 4 % | 5 % | 100 % | 100 % |" in estimates_table([drag])
