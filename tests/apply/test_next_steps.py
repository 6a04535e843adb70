"""Situations and the steps that follow from them."""

import math
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pytest
from tests.apply.statistics.test_leave_one_out import flight as evidence_of
from tests.apply.test_choice import PRESENT, one

from fusetune.apply.candidates import Candidate
from fusetune.apply.choice import Choice
from fusetune.apply.delays import UNCONFIRMED
from fusetune.apply.evidence import DISTRUSTED, AnalyzedFlight, NoEvidence
from fusetune.apply.missing_motion import MissingMotion
from fusetune.apply.missing_motion_kinds import DELAYS, THINNED
from fusetune.apply.next_steps import (
    CONFIRM,
    FLY,
    LOAD,
    LOG,
    MOST_STEPS,
    OWN_LOGS,
    SEARCH,
    STOP,
    STUDY,
    NextStep,
    Situation,
    next_steps,
    refused_remedies,
    steps_sentence,
)
from fusetune.apply.parameter_changes import ParameterChange
from fusetune.apply.parameter_files.vehicle_changes import RefusedChange
from fusetune.apply.power.power import Power, PowerCurve
from fusetune.apply.ranking import RankedSet
from fusetune.apply.settings import DecisionSettings
from fusetune.finding import Finding

SETTINGS = DecisionSettings()
LEGS = MissingMotion(DELAYS, "No flight accelerates hard enough to tell the delay of GNSS", "three legs")
THIN = MissingMotion(THINNED, "GNSS stands in these logs 2.0 times a second", "log whole")
DELAY = Finding(UNCONFIRMED, "note", "late", "", evidence={"parameter": "EKF2_GPS_DELAY", "mended_ms": 160.0})
MAGNETOMETER = Candidate("measured_mag_noise", {"EKF2_MAG_NOISE": 0.03}, "")
WIDE = one("wide", -0.05, 0.02)
"""Interval −12 to +2 %: it may gain what matters."""
NARROW = one("narrow", 0.001, 0.005)
"""Interval −0.3 to +0.5 %: no gain of 1 %."""
VETOED = one("vetoed", -0.2, -0.1, reasons=("resets",))
SOLD = ParameterChange("EKF2_ACC_NOISE", 0.35, 0.2, "FLOAT", "m/s^2", False)


def curves(needed: dict[float, int | None]) -> Power:
    """Seven flights of three minutes, of which so many find each gain."""
    found = [
        PowerCurve(gain, 1.0, (4, 40), (0.0, 0.5)) if many is None else PowerCurve(gain, 1.0, (many, 40), (0.8, 1.0))
        for gain, many in needed.items()
    ]
    return Power(7, 3.0, 0.5, tuple(found))


NOT_HAD = RefusedChange("EKF2_GRAV_NOISE", "v1.13.3, which the vehicle flies, has no such parameter", "Leave it out")
POWER = curves({5.0: None, 10.0: 12, 20.0: 6})


def flights(number: int, without: NoEvidence | None = None) -> list[AnalyzedFlight]:
    evidence = None if without else evidence_of("f", [0.0, -0.1])
    return [AnalyzedFlight(f"f{i}", Path("f"), {}, pa.table({}), evidence, without) for i in range(number)]


def keep(*ranked: RankedSet, number: int = 7, **changes) -> Situation:  # type: ignore[no-untyped-def]
    choice = Choice("keep", "a", None, None, number < 5, None)
    overrides = {"wide": ["EKF2_GPS_V_NOISE"], "narrow": ["EKF2_ACC_NOISE", "EKF2_BARO_NOISE"]}
    return replace(
        Situation(choice, [PRESENT, *ranked], flights(number), (), (), (), (), POWER, overrides), **changes
    )  # fmt: skip


def change(exploratory: bool = False, **changes) -> Situation:  # type: ignore[no-untyped-def]
    pick = one("b", math.log(0.88), math.log(0.95))
    choice = Choice("change", "b", pick, pick, exploratory, None)
    return replace(keep(pick, number=4 if exploratory else 7), choice=choice, **({"changes": (SOLD,)} | changes))


NO_FLIGHT = replace(keep(number=0), choice=Choice("no_evidence", "a", None, None, True, None), power=None)

SITUATIONS = {
    "keep, wide intervals": (keep(WIDE), [FLY, SEARCH]),
    "keep, wide intervals, as many flights as help": (keep(WIDE, power=curves({5.0: 60, 10.0: 6, 20.0: 4})), [SEARCH]),
    "keep, wide intervals, a noise told wrong": (keep(WIDE, candidates=[MAGNETOMETER]), [FLY, STUDY, SEARCH]),
    "keep, narrow intervals": (keep(NARROW), [STOP]),
    "keep, narrow intervals, a noise told wrong": (keep(NARROW, candidates=[MAGNETOMETER]), [STUDY]),
    "keep, everything worse, how much is not sure": (keep(replace(WIDE, worse_aims=("smoothed",))), [SEARCH]),
    "keep, everything vetoed": (keep(VETOED), [SEARCH]),
    "keep, everything vetoed, something between": (keep(VETOED, candidates=[MAGNETOMETER]), [STUDY]),
    "keep, nothing to compare": (keep(), [SEARCH]),
    "keep, a delay told but not set": (keep(NARROW, delays=[DELAY]), [SEARCH]),
    "keep, a delay told but not set, thinned logs": (keep(NARROW, delays=[DELAY], missing=[THIN]), [SEARCH, LOG]),
    "keep, too few flights": (keep(WIDE, number=3), [FLY]),
    "keep, too few flights, a noise told wrong": (keep(WIDE, number=3, candidates=[MAGNETOMETER]), [FLY, STUDY]),
    "change": (change(), [LOAD, CONFIRM, LOAD]),
    "change that the vehicle cannot be given": (change(not_loadable=[NOT_HAD]), [STUDY]),
    "change, too few flights": (change(exploratory=True), [LOAD, CONFIRM, LOAD]),
    "no flight at all": (NO_FLIGHT, [FLY]),
    "no evidence, logs refused": (replace(NO_FLIGHT, refused=["log more", "fly GNSS", "log more"]), [LOG, FLY]),
    "no evidence, replays not trusted": (
        replace(NO_FLIGHT, flights=flights(2, NoEvidence(DISTRUSTED, "grade D"))), [LOG, FLY]
    ),
    "simulated": (change(is_simulated=True), [OWN_LOGS]),
}  # fmt: skip


@pytest.mark.parametrize(("now", "kinds"), SITUATIONS.values(), ids=SITUATIONS.keys())
def test_what_follows_from_a_situation(now: Situation, kinds: list[str]) -> None:
    steps = next_steps(now, SETTINGS)
    assert [step.kind for step in steps] == kinds
    assert 1 <= len(steps) <= MOST_STEPS
    assert all(step.text.endswith(".") for step in steps)


def said(now: Situation) -> list[str]:
    return [step.text for step in next_steps(now, SETTINGS)]


def test_a_gain_is_promised_with_the_flights_that_it_takes() -> None:
    assert said(keep(WIDE)) == [
        "With 5 more flights of 3 minutes, a gain of 10 % would be found with 80 %.",
        "EKF2_GPS_V_NOISE could still matter: search around the present values.",
    ]
    assert "flights of 3 minutes, with three legs, a gain" in said(keep(WIDE, missing=[LEGS, THIN]))[0]


def test_parameters_that_are_fine_are_left_alone() -> None:
    assert said(keep(NARROW)) == [
        "These parameters are fine as they are, stop tuning them (EKF2_ACC_NOISE, EKF2_BARO_NOISE): no value that was "
        "tried gains 1 % on these flights."
    ]


def test_a_change_is_loaded_confirmed_and_can_be_taken_back() -> None:
    """12 % were found; 12 flights find 10 %."""
    assert said(change()) == [
        "Load best_params.params, and fly a short, safe flight first.",
        "Then fly 12 flights of 3 minutes with it, add the logs and run again: they confirm the change, or not.",
        "If the vehicle flies worse, load rollback.params: it brings the old values back.",
    ]
    assert "params, reboot, and fly" in said(change(changes=(replace(SOLD, reboot_required=True),)))[0]
    assert "it rests on 4 flights only" in said(change(exploratory=True))[1]


def test_too_few_flights_are_told_how_many() -> None:
    assert said(keep(WIDE, number=3))[0] == (
        "Fly 2 more flights of 3 minutes and run again; for a gain of 10 % it takes 5 more."
    )
    assert said(keep(WIDE, number=4, power=None))[0].startswith("Fly 1 more flight of 3 minutes and run again: fewer")


def test_refused_logs_are_told_what_to_log_the_most_frequent_first() -> None:
    assert said(replace(NO_FLIGHT, refused=["fly GNSS", "log more", "log more"]))[0] == (
        "Log more (for each refused log, flights.csv says what it lacks)."
    )
    advice = [{"id": "imu", "severity": "fail", "found": "slow", "remedy": "log more"}]
    rows = [{"status": "refused", "advice": advice}, {"status": "replayable", "advice": advice}, {"status": "refused"}]
    assert refused_remedies(rows) == ["log more"]


def test_steps_are_one_paragraph() -> None:
    assert steps_sentence([NextStep(FLY, "Fly.")]) == "Next: Fly."
    assert steps_sentence([NextStep(FLY, "Fly."), NextStep(LOG, "Log.")]) == "Next: (1) Fly. (2) Log."
