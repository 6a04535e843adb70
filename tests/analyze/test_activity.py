"""A parameter that cannot act on a flight is named with the reason."""

from pathlib import Path

from tests.analyze.made_flight import MadeSet, make_flight

from fusetune.analyze.activity import inactive_parameters, same_results
from fusetune.analyze.set_files import SetRecord, read_set
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
    assert isinstance(a, SetRecord)
