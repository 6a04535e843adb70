"""A parameter that cannot act on a flight is named with the reason."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.analyze.made_flight import MadeSet, make_flight

from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.store.reader import read_set
from fusetune.analyze.scoring.activity import inactive_parameters, same_results
from fusetune.px4.parameter_sources import required_sources, switched_off
from fusetune.save.flight_folder import load_flight


def reasons(root: Path, overrides: dict[str, float]) -> dict[str, str]:
    save, folder = make_flight(root, "flight", {"present": MadeSet(), "other": MadeSet(overrides=overrides)})
    return inactive_parameters(read_set(folder, "other"), read_set(folder, "present"), load_flight(save))


def test_a_floor_below_the_receivers_accuracy_does_nothing(tmp_path: Path) -> None:
    # The made receiver reports eph 0.9 m; the present floor is 0.5 m.
    assert "the receiver reports 0.9 m" in reasons(tmp_path, {"EKF2_GPS_P_NOISE": 0.7})["EKF2_GPS_P_NOISE"]


def test_a_floor_above_the_receivers_accuracy_acts(tmp_path: Path) -> None:
    # It reports 0.2 m/s, the present floor is 0.3 m/s.
    assert reasons(tmp_path, {"EKF2_GPS_V_NOISE": 0.1, "EKF2_GPS_P_NOISE": 2.0}) == {}


def test_parameters_of_a_sensor_that_is_not_there(tmp_path: Path) -> None:
    found = reasons(tmp_path, {"EKF2_RNG_NOISE": 0.2, "EKF2_EVP_NOISE": 0.2, "EKF2_ACC_NOISE": 0.5})
    assert set(found) == {"EKF2_RNG_NOISE", "EKF2_EVP_NOISE"}


def test_the_same_value_as_now(tmp_path: Path) -> None:
    assert reasons(tmp_path, {"EKF2_ACC_NOISE": 0.35}) == {"EKF2_ACC_NOISE": "has the same value in the present set"}


def test_equal_replays_are_recognised(tmp_path: Path) -> None:
    _, folder = make_flight(tmp_path, "flight", {"a": MadeSet(own=0.0), "b": MadeSet(own=0.0), "c": MadeSet(own=0.1)})
    a, b, c = (read_set(folder, name) for name in "abc")
    assert same_results(a, b)
    assert not same_results(a, c)
    assert isinstance(a, ReplayedSet)


def test_a_vertical_floor_can_act_while_the_horizontal_one_cannot(tmp_path: Path) -> None:
    # The receiver reports eph 0.9 m and epv 1.0 m; a floor of 0.7 m is 1.05 m for the height (factor 1.5).
    save, folder = make_flight(
        tmp_path, "flight", {"present": MadeSet(), "other": MadeSet(overrides={"EKF2_GPS_P_NOISE": 0.7})}
    )
    flight = load_flight(save)
    table = flight.topics["vehicle_gps_position", 0]
    other, present = (
        replace(record, samples={**record.samples, ("gnss_hgt", 0): record.samples["baro_hgt", 0]})
        for record in (read_set(folder, "other"), read_set(folder, "present"))
    )
    table["epv"] = np.full(table["timestamp"].size, 1.0, np.float32)
    assert "EKF2_GPS_P_NOISE" not in inactive_parameters(other, present, flight)
    table["epv"] += np.float32(0.1)
    assert "reports 0.9 and 1.1 m" in inactive_parameters(other, present, flight)["EKF2_GPS_P_NOISE"]


def test_a_gate_that_no_sample_reaches_never_binds(tmp_path: Path) -> None:
    # 375 made innovations of 1/3 standard deviation: the largest of them is near 1, far from 3.
    found = reasons(tmp_path, {"EKF2_BARO_GATE": 3.0})
    assert found["EKF2_BARO_GATE"].endswith("so the gate never binds")


def test_a_gate_that_samples_reach_acts(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=1.5), "other": MadeSet(error=1.5, overrides={"EKF2_BARO_GATE": 3.0})}
    save, folder = make_flight(tmp_path, "flight", sets)
    assert inactive_parameters(read_set(folder, "other"), read_set(folder, "present"), load_flight(save)) == {}


def test_a_noise_that_leaves_the_observation_variances_alone_does_nothing(tmp_path: Path) -> None:
    found = reasons(tmp_path, {"EKF2_BARO_NOISE": 1.0})
    assert found["EKF2_BARO_NOISE"].startswith("leaves every observation variance")


def test_velocity_parameters_need_velocity_and_not_only_position(tmp_path: Path) -> None:
    save, folder = make_flight(
        tmp_path, "flight", {"present": MadeSet(), "other": MadeSet(overrides={"EKF2_GPS_V_GATE": 3.0})}
    )
    other, present = (
        replace(
            record,
            parameters=record.parameters | {"EKF2_GPS_CTRL": 3.0},
            samples={key: record.samples[key] for key in record.samples if key[0] != "gnss_vel"},
        )
        for record in (read_set(folder, "other"), read_set(folder, "present"))
    )
    found = inactive_parameters(other, present, load_flight(save))
    assert found == {"EKF2_GPS_V_GATE": "no gnss_vel was fused on this flight (EKF2_GPS_CTRL is 3)"}


def test_a_switch_is_the_cause_only_where_it_keeps_out_all_sources() -> None:
    assert switched_off("ev_pos", {"EKF2_EV_CTRL": 2.0}) == "EKF2_EV_CTRL is 2"
    assert switched_off("ev_hgt", {"EKF2_EV_CTRL": 2.0}) == ""
    assert switched_off("mag", {"EKF2_MAG_TYPE": 5.0}) == "EKF2_MAG_TYPE is 5"


def test_the_longest_prefix_names_the_sources_of_a_parameter() -> None:
    assert required_sources("EKF2_GPS_V_NOISE") == ("gnss_vel",)
    assert required_sources("EKF2_EVP_GATE") == ("ev_pos", "ev_hgt")
    assert required_sources("EKF2_ACC_NOISE") == ()


def test_replays_that_agree_in_every_innovation_make_all_overrides_inactive(tmp_path: Path) -> None:
    sets = {"present": MadeSet(own=0.0), "other": MadeSet(own=0.0, overrides={"EKF2_ACC_NOISE": 0.3})}
    save, folder = make_flight(tmp_path, "flight", sets)
    found = inactive_parameters(read_set(folder, "other"), read_set(folder, "present"), load_flight(save))
    assert found == {"EKF2_ACC_NOISE": "every innovation is the same as with the present value"}
