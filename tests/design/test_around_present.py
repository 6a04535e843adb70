"""Studies around what flies now: what the flights exercise is varied, and what would do nothing is left out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.design.around_present import Exercise, study_around
from fusetune.design.study import load_study
from fusetune.design.tunable_parameters import TUNABLE_PARAMETERS, USUALLY_VARIED
from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, check_value

DEFAULTS = {name: one.default for name, one in PARAMETERS.items()}
SENSORS = frozenset({"vehicle_gps_position", "vehicle_magnetometer", "vehicle_air_data"})
FLIGHT = Exercise(SENSORS, DEFAULTS, {"eph": 0.2, "epv": 0.3, "s_variance_m_s": 0.1}, (0.1, 1.0, 1.0))


def values(*flights: Exercise, parameters: tuple[str, ...] = USUALLY_VARIED, present: dict = DEFAULTS) -> dict:
    sets = study_around(present, parameters, flights).sets
    return {one.name: one.overrides for one in sets}


def test_steps_of_each_kind_by_hand() -> None:
    found = values(FLIGHT)
    assert found["acc_noise_up"] == {"EKF2_ACC_NOISE": 0.7}
    assert found["acc_noise_down"] == {"EKF2_ACC_NOISE": 0.175}
    assert found["gyr_b_noise_up"] == {"EKF2_GYR_B_NOISE": 0.003}
    assert found["gps_v_gate_down"] == {"EKF2_GPS_V_GATE": 2.5}
    assert found["gps_delay_down"] == {"EKF2_GPS_DELAY": 70.0}
    assert found["gps_pos_y_up"] == {"EKF2_GPS_POS_Y": 0.2}


def test_only_sensors_that_are_there_and_switched_on_are_varied() -> None:
    varied = {name for overrides in values(FLIGHT).values() for name in overrides}
    assert not [name for name in varied if name.startswith(("EKF2_EV", "EKF2_OF_", "EKF2_RNG_", "EKF2_ASP_"))]
    vision = replace(FLIGHT, topics=SENSORS | {"vehicle_visual_odometry"}, parameters={**DEFAULTS, "EKF2_EV_CTRL": 4})
    assert {"evv_noise_up", "ev_delay_up"} <= values(FLIGHT, vision).keys()
    assert "evp_noise_up" not in values(FLIGHT, vision)  # vision velocity alone is fused
    off = replace(FLIGHT, parameters={**DEFAULTS, "EKF2_GPS_CTRL": 0})
    assert not [name for name in values(off) if name.startswith("gps_")]


def test_why_something_is_left_out_is_said() -> None:
    left_out = study_around(DEFAULTS, USUALLY_VARIED, [FLIGHT]).left_out
    assert left_out["EKF2_EVP_NOISE"] == "EKF2_EV_CTRL is 0"
    assert left_out["EKF2_RNG_NOISE"] == "no range finder in the logs"
    assert left_out["baro_delay_down"] == "its sane range ends there"
    assert left_out["EKF2_GPS_POS_X"] == "the flights turn too little: a step would make 0.02 m/s"


@pytest.mark.parametrize(
    ("reported", "names"),
    [
        (0.1, {"gps_v_noise_down", "gps_v_noise_up"}),  # below the floor of 0.3, which rules
        (0.35, {"gps_v_noise_up"}),  # above it: a smaller one does nothing
        (0.7, set()),  # above twice the floor, too
    ],
)
def test_a_floor_below_what_the_receiver_reports_is_left_alone(reported: float, names: set[str]) -> None:
    flight = replace(FLIGHT, reported={"s_variance_m_s": reported})
    assert {name for name in values(flight) if "gps_v_noise" in name} == names
    # one flight on which it acts is enough
    assert len([name for name in values(flight, FLIGHT) if "gps_v_noise" in name]) == 2


def test_another_flight_or_parameter_leaves_the_other_sets_as_they_are() -> None:
    vision = replace(FLIGHT, topics=SENSORS | {"vehicle_visual_odometry"}, parameters={**DEFAULTS, "EKF2_EV_CTRL": 15})
    more = values(FLIGHT, vision, parameters=(*USUALLY_VARIED, "EKF2_HEAD_NOISE"))
    assert values(FLIGHT).items() <= more.items()
    assert len(more) > len(values(FLIGHT))


def test_what_the_logs_differ_in_is_in_every_set() -> None:
    found = study_around(DEFAULTS, USUALLY_VARIED, [FLIGHT], {"EKF2_MAG_NOISE": 0.05})
    by_name = {one.name: one.overrides for one in found.sets}
    assert by_name["acc_noise_up"] == {"EKF2_MAG_NOISE": 0.05, "EKF2_ACC_NOISE": 0.7}
    assert by_name["mag_noise_up"] == {"EKF2_MAG_NOISE": 0.1}


@given(st.dictionaries(st.sampled_from(list(TUNABLE_PARAMETERS)), st.floats(-10.0, 500.0), max_size=20))
def test_whatever_flies_the_sets_can_be_loaded(odd: dict[str, float]) -> None:
    """PX4's own range is kept, by a value of the vehicle inside it; no set is the present one again."""
    present = {name: value for name, value in odd.items() if _is_taken(name, value)}
    for name, overrides in values(FLIGHT, parameters=tuple(TUNABLE_PARAMETERS), present=DEFAULTS | present).items():
        for parameter, value in overrides.items():
            check_value(parameter, value)
            assert value != (DEFAULTS | present)[parameter], name


def _is_taken(name: str, value: float) -> bool:
    try:
        check_value(name, value)
    except ValueError:
        return False
    return True


def test_a_study_names_parameters_of_the_catalogue(tmp_path: Path) -> None:
    file = tmp_path / "study.yaml"
    file.write_text("name: s\nkind: around_present\nparameters: [EKF2_MAG_NOISE]\n", encoding="utf-8")
    study = load_study(file)
    assert (study.sets, study.around) == ((), ("EKF2_MAG_NOISE",))
    file.write_text("name: s\nkind: around_present\nparameters: [EKF2_GPS_CTRL]\n", encoding="utf-8")
    with pytest.raises(UserError, match=r"EKF2_GPS_CTRL is none of those that are tuned"):
        load_study(file)


def test_the_shipped_study_varies_what_usually_matters(project_root: Path) -> None:
    assert load_study(project_root / "config/studies/around_present.yaml").around == USUALLY_VARIED
