"""Parameters of other releases than the baseline, as the estimator of a release takes them."""

from __future__ import annotations

import pytest

from fusetune.px4.flight import ParameterHistory
from fusetune.px4.parameters.complete_sets import complete
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, ParameterError, check_by, defaults_of
from fusetune.px4.parameters.set_names import in_baseline_names, of_vehicle, read_by
from fusetune.px4.parameters.updated_parameters import after_update, changed_by_update
from fusetune.px4.releases import BASELINE, DEVELOPMENT, ESTIMATORS, number_of_name

V1_13, V1_14, V1_17 = (1, 13), (1, 14), (1, 17)


def test_the_baseline_has_the_defaults_that_it_had() -> None:
    assert defaults_of(BASELINE) == {name: one.default for name, one in PARAMETERS.items()}
    for name in ESTIMATORS:
        assert {*PARAMETERS} <= {*defaults_of(number_of_name(name))}


def test_a_release_has_its_own_defaults_under_the_names_of_the_baseline() -> None:
    """PX4's metadata of v1.13: EKF2_HGT_MODE 0 (barometer), EKF2_WIND_NOISE 0.1, a tenth of which is the density."""
    assert defaults_of(V1_13)["EKF2_HGT_REF"] == 0.0
    assert defaults_of(V1_13)["EKF2_WIND_NSD"] == pytest.approx(0.01)
    assert defaults_of(V1_13)["EKF2_GPS_CTRL"] == 7.0  # bit 0 of EKF2_AID_MASK, which is set
    assert [defaults_of(one)["EKF2_GPS_CHECK"] for one in (V1_14, BASELINE, V1_17)] == [245.0, 1023.0, 2047.0]
    assert "EKF2_GPS_MODE" not in defaults_of(BASELINE)
    assert defaults_of(V1_17)["EKF2_REQ_FIX"] == 3.0


def test_what_only_a_release_has_is_read_where_it_is_replayed() -> None:
    logged = {"EKF2_GPS_MODE": 1, "EKF2_GPS_V_NOISE": 0.5, "EKF2_MAG_TYPE": 2}
    assert "EKF2_GPS_MODE" not in complete(logged, {}, V1_17)
    assert complete(logged, {}, V1_17, replayed=V1_17)["EKF2_GPS_MODE"] == 1.0
    assert complete(logged, {"EKF2_GPS_MODE": 0}, V1_17, replayed=V1_17)["EKF2_GPS_MODE"] == 0.0
    # 3D was given up with v1.15; before, it is flown
    assert [complete(logged, {}, V1_14, replayed=one)["EKF2_MAG_TYPE"] for one in (V1_14, BASELINE)] == [2.0, 0.0]


def test_newer_names_are_translated_and_what_has_no_counterpart_is_refused_by_name() -> None:
    assert in_baseline_names({"SENS_GPS0_DELAY": 80, "EKF2_ACC_NOISE": 0.5}) == {
        "EKF2_GPS_DELAY": 80, "EKF2_ACC_NOISE": 0.5,
    }  # fmt: skip
    with pytest.raises(ParameterError, match="SENS_GPS0_DELAY: is what newer releases call EKF2_GPS_DELAY"):
        in_baseline_names({"SENS_GPS0_DELAY": 80, "EKF2_GPS_DELAY": 90})
    assert read_by("SENS_GPS0_DELAY").name == "EKF2_GPS_DELAY"
    assert read_by("EKF2_GPS_MODE", V1_17).name == "EKF2_GPS_MODE"
    with pytest.raises(ParameterError, match=r"EKF2_GPS_MODE: v1\.16 has no such parameter, v1\.17 to main have it"):
        read_by("EKF2_GPS_MODE")
    with pytest.raises(ParameterError, match=r"v1\.17 has no such parameter, only main has it"):
        read_by("EKF2_POS_LOCK", V1_17)
    with pytest.raises(ParameterError, match="Use EKF2_RNG_CTRL instead"):
        read_by("EKF2_RNG_AID")
    assert read_by("EKF2_RNG_AID", V1_13).name == "EKF2_RNG_AID"
    assert read_by("EKF2_GPS_CTRL", V1_13).name == "EKF2_GPS_CTRL"  # bits of EKF2_AID_MASK there
    with pytest.raises(ParameterError, match=r"v1\.13 has no such parameter, v1\.14 to main have it"):
        read_by("EKF2_GRAV_NOISE", V1_13)
    with pytest.raises(ParameterError, match=r"v1\.17 has no such parameter, v1\.8 to v1\.16 have it"):
        read_by("EKF2_RNG_A_IGATE", V1_17)


def test_values_that_were_given_up_are_allowed_where_they_are_flown() -> None:
    """PX4's metadata of v1.14: EKF2_MAG_TYPE 2 (3-axis) and 4 (indoor), bit 2 of EKF2_DECL_TYPE."""
    for name, value in (("EKF2_MAG_TYPE", 2), ("EKF2_MAG_TYPE", 4), ("EKF2_DECL_TYPE", 7)):
        for release in (V1_13, V1_14):
            check_by(read_by(name, release), value)
        with pytest.raises(ParameterError):
            check_by(read_by(name, (1, 15)), value)


def test_all_parameters_of_a_vehicle_are_those_that_its_estimator_reads() -> None:
    vehicle = {"EKF2_AID_MASK": 3, "EKF2_HGT_MODE": 2, "EKF2_WIND_NOISE": 0.2, "SENS_BARO_RATE": 20.0}
    told = {
        "EKF2_GPS_CTRL": 7.0, "EKF2_OF_CTRL": 1.0, "EKF2_EV_CTRL": 0.0, "EKF2_DRAG_CTRL": 0.0, "EKF2_IMU_CTRL": 7.0,
        "EKF2_HGT_REF": 2.0, "EKF2_RNG_CTRL": 2.0, "EKF2_WIND_NSD": 0.02,
    }  # fmt: skip
    assert of_vehicle(vehicle, V1_13) == vehicle
    assert of_vehicle(vehicle, V1_14) == told | {"SENS_BARO_RATE": 20.0}
    assert of_vehicle(vehicle, BASELINE) == told
    assert of_vehicle({"SENS_GPS0_DELAY": 90.0, "SENS_GPS1_DELAY": 50.0}, DEVELOPMENT) == {"EKF2_GPS_DELAY": 90.0}


def test_an_update_takes_defaults_along_and_leaves_what_was_set() -> None:
    logged = ParameterHistory({"EKF2_GPS_CHECK": 245, "EKF2_TAS_GATE": 4.0, "EKF2_ACC_NOISE": 0.35})
    assert after_update(logged, V1_14, V1_17) == {"EKF2_GPS_CHECK": 2047.0}
    assert after_update(logged, V1_14, V1_14) == {}
    changed = changed_by_update(logged, V1_14, V1_17, {"EKF2_GPS_CHECK": 2047.0})
    assert changed["EKF2_GPS_CHECK"] == (245.0, 2047.0)
    assert changed["EKF2_REQ_FIX"] == (None, 3.0)
    assert "EKF2_TAS_GATE" not in changed
    # back to v1.13, which has a mask and takes the height from one source: GPS alone, the barometer
    newer = ParameterHistory({"EKF2_GPS_CTRL": 7, "EKF2_OF_CTRL": 1, "EKF2_HGT_REF": 1, "EKF2_GRAV_NOISE": 1.0})
    assert after_update(newer, BASELINE, V1_13) == {"EKF2_AID_MASK": 1.0, "EKF2_HGT_MODE": 0.0}
    # the airframe's default is no default of the release
    airframe = ParameterHistory({"EKF2_GPS_CHECK": 245}, default_current_setup={"EKF2_GPS_CHECK": 245})
    assert after_update(airframe, V1_14, V1_17) == {}
    # what the log calls the default counts before the table
    own = ParameterHistory({"EKF2_GPS_CHECK": 21}, default_system={"EKF2_GPS_CHECK": 21})
    assert after_update(own, V1_14, V1_17) == {"EKF2_GPS_CHECK": 2047.0}
