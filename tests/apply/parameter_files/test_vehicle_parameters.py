"""What a log tells of its vehicle's parameters."""

from __future__ import annotations

from fusetune.apply.parameter_files.vehicle_parameters import VehicleParameters

LOGGED = {
    "EKF2_GPS_DELAY": 110.0,
    "EKF2_MAG_DECL": 3.2,
    "SENS_GPS0_DELAY": 110.0,
    "CAL_MAG0_XOFF": 0.01,
    "MPC_XY_P": 1.0,
}


def test_a_decision_rests_on_the_estimators_parameters_alone() -> None:
    by_the_pilot = VehicleParameters({**LOGGED, "EKF2_DECL_TYPE": 1})
    assert by_the_pilot.judged.keys() == {"EKF2_DECL_TYPE", "EKF2_GPS_DELAY", "EKF2_MAG_DECL", "SENS_GPS0_DELAY"}


def test_a_declination_that_px4_saves_itself_is_not_held_against_the_vehicle() -> None:
    """Bit 1 of EKF2_DECL_TYPE, which is set by default."""
    assert "EKF2_MAG_DECL" not in VehicleParameters(LOGGED).judged
    assert "EKF2_MAG_DECL" not in VehicleParameters({**LOGGED, "EKF2_DECL_TYPE": 2}).judged
