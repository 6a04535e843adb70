"""Flights after a change are those that flew it, and nothing else new."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fusetune.apply.history.entries import DecisionEntry, Gain
from fusetune.apply.history.flights_after import FlownFlight, change_flown, flew, why_not_after
from fusetune.px4.parameters.ekf2_parameters import as_float32
from fusetune.px4.vehicle_identity import VehicleIdentity

VEHICLE = VehicleIdentity("0123", "PX4_FMU_V5", "4001", "quadrotor")
NOT_KNOWN = Gain(None, None, None, 0, 0.95)
ENTRY = DecisionEntry(
    key="first",
    written="2026-01-02T00:00:00Z",
    vehicle=VEHICLE,
    product="fusetune",
    status="change",
    chosen="better",
    exploratory=False,
    is_loadable=True,
    decided_after="2026-01-01T10:00:00Z",
    before={"EKF2_ACC_NOISE": 0.349999994, "EKF2_GYR_NOISE": 0.0149999997, "EKF2_MAG_DECL": 1.0},
    changes={"EKF2_ACC_NOISE": 0.8},
    predicted=NOT_KNOWN,
    evidence=(),
    of_decision=("aa",),
    sets=(),
    study={},
)
AFTER = FlownFlight(
    "new",
    "bb",
    VEHICLE,
    "2026-01-03T10:00:00Z",
    # PX4 writes the declination back itself
    {"EKF2_ACC_NOISE": as_float32(0.8), "EKF2_GYR_NOISE": as_float32(0.015), "EKF2_MAG_DECL": 1.7, "EKF2_X": 1.0},
)


def test_a_flight_that_flew_the_change_came_after_it() -> None:
    assert why_not_after(ENTRY, AFTER) == ""
    assert flew(AFTER, ENTRY.after)
    assert not flew(AFTER, ENTRY.before)


@pytest.mark.parametrize(
    ("flight", "said"),
    [
        (replace(AFTER, vehicle=replace(VEHICLE, uuid="4567")), "of another vehicle"),
        (replace(AFTER, checksum="aa"), "was made from it"),
        (replace(AFTER, recorded=""), "do not tell which"),
        (replace(AFTER, recorded=ENTRY.decided_after), "before the decision"),
        (replace(AFTER, changed_in_flight=True), "changed in flight"),
        (replace(AFTER, parameters=AFTER.parameters | {"EKF2_ACC_NOISE": 0.7}), "did not fly EKF2_ACC_NOISE = 0.8"),
        (replace(AFTER, parameters=AFTER.parameters | {"EKF2_GYR_NOISE": 0.02}), "EKF2_GYR_NOISE was changed as well"),
    ],
)
def test_any_other_says_nothing_of_it(flight: FlownFlight, said: str) -> None:
    assert said in why_not_after(ENTRY, flight)
    assert change_flown([ENTRY], flight) is None


def test_what_was_kept_or_could_not_be_loaded_is_no_change() -> None:
    for entry in (replace(ENTRY, changes={}), replace(ENTRY, is_loadable=False)):
        assert why_not_after(entry, AFTER) == "nothing was changed"


def test_of_several_changes_that_fit_the_last_one_counts() -> None:
    again = replace(ENTRY, key="again", before=ENTRY.after, changes={"EKF2_ACC_NOISE": 0.8})
    other = replace(ENTRY, key="other", changes={"EKF2_ACC_NOISE": 0.5})
    found = change_flown([ENTRY, again, other], AFTER)
    assert found is again
