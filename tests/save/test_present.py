from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from fusetune.errors import UserError
from fusetune.px4.vehicle_identity import VehicleIdentity
from fusetune.save import FlightSets, Present, find_present, flight_folder, read_present, write_present
from fusetune.set_names import AS_FLOWN, PRESENT, RESERVED_SET_NAMES
from fusetune.storage.documents import write_document

QUADROTOR = VehicleIdentity("0001" + "0" * 28 + "003a", "PX4_FMU_V4", "4011", "quadrotor")
OCTOROTOR = VehicleIdentity("0002" + "0" * 28 + "002d", "PX4_FMU_V5", "8001", "octorotor")
SITL = VehicleIdentity("", "PX4_SITL", "4001", "quadrotor", "SITL")
HITL = VehicleIdentity(QUADROTOR.uuid, "PX4_FMU_V4", "4011", "quadrotor", "HITL")
VARIED = ("EKF2_GPS_V_NOISE", "EKF2_ACC_NOISE", "EKF2_NOT_IN_THESE_LOGS")


@pytest.fixture
def folders(tmp_path: Path) -> dict[str, Path]:
    """Saved flights, of which only the metadata is looked at."""
    found = {}
    for number, flight in enumerate(("a", "b", "c")):
        found[flight] = tmp_path / flight
        found[flight].mkdir()
        parameters = {"EKF2_GPS_V_NOISE": 0.1 * number, "EKF2_ACC_NOISE": 0.35, "EKF2_MAG_NOISE": 0.05}
        metadata = {
            "format": flight_folder._FORMAT,
            "topics": {},
            "checksum": f"sum of {flight}",
            "ekf2_parameters": parameters,
        }
        write_document(tmp_path / flight / "metadata.json", metadata)
    return found


def row(
    flight: str,
    recorded: str,
    status: str = "replayable",
    vehicle: VehicleIdentity = QUADROTOR,
    airborne_s: float = 60.0,
) -> dict[str, Any]:
    row = {"flight": flight, "recorded": recorded, "status": status, "airborne_s": airborne_s}
    return row | vehicle.columns()


def test_the_newest_flight_that_can_be_replayed_is_present(folders: dict[str, Path]) -> None:
    rows = [row("c", "2026-05-03", "refused"), row("b", "2026-05-02"), row("a", "2026-05-01")]
    present = find_present(rows, folders, VARIED, None)
    assert present == Present("b", "sum of b", {"EKF2_ACC_NOISE": 0.35, "EKF2_GPS_V_NOISE": 0.1}, ("b",))


def test_of_flights_of_one_time_the_last_by_name_is_present(folders: dict[str, Path]) -> None:
    rows = [row("c", ""), row("a", ""), row("b", "")]
    assert find_present(rows, folders, VARIED, None).flight == "c"


def test_the_flight_that_was_asked_for_is_present(folders: dict[str, Path]) -> None:
    assert find_present([row("a", "2026"), row("b", "2025")], folders, VARIED, "b").checksum == "sum of b"


def test_a_refused_flight_cannot_be_asked_for(folders: dict[str, Path]) -> None:
    with pytest.raises(UserError, match=r"'a' is no flight that can be replayed.*flights\.csv"):
        find_present([row("a", "", "refused"), row("b", "")], folders, VARIED, "a")


def test_without_a_flight_there_is_no_present(folders: dict[str, Path]) -> None:
    assert find_present([row("a", "", "refused")], folders, VARIED, None) == Present(None, None, {})


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    present = Present("a", "0123", {"EKF2_ACC_NOISE": 0.1, "EKF2_GPS_V_NOISE": 1 / 3}, ("a", "c"))
    write_present(tmp_path / "present.json", present)
    assert read_present(tmp_path / "present.json") == present


class Grades:
    """What a flight counts for, and which flights it was asked of: each costs a replay."""

    def __init__(self, *counting: str) -> None:
        self.counting, self.asked = counting, []

    def __call__(self, flight: str) -> bool:
        self.asked.append(flight)
        return flight in self.counting


@pytest.mark.parametrize("simulated", [SITL, HITL])
def test_a_newer_simulated_flight_is_passed_over_for_a_real_one(
    folders: dict[str, Path], simulated: VehicleIdentity
) -> None:
    rows = [row("a", "2026-05-01"), row("b", "2026-05-02"), row("c", "2026-05-03", vehicle=simulated)]
    counts = Grades("b")
    assert find_present(rows, folders, VARIED, None, None, counts).flight == "b"
    assert counts.asked == ["b"]


def test_where_all_is_simulated_that_decides(folders: dict[str, Path]) -> None:
    rows = [row("a", "2026-05-01", vehicle=SITL), row("b", "2026-05-02", vehicle=SITL)]
    assert find_present(rows, folders, VARIED, None).flight == "b"


def test_a_flight_that_does_not_count_does_not_say_what_flies_now(folders: dict[str, Path]) -> None:
    rows = [row("a", "2026-05-01"), row("b", "2026-05-02"), row("c", "2026-05-03")]
    counts = Grades("a", "b")
    present = find_present(rows, folders, VARIED, None, None, counts)
    assert (present.flight, present.parameters["EKF2_GPS_V_NOISE"]) == ("b", 0.1)
    assert counts.asked == ["c", "b"]


def test_nor_does_it_say_which_vehicle_is_decided_for(folders: dict[str, Path]) -> None:
    rows = [row("a", "2026-05-01"), row("c", "2026-05-03", vehicle=OCTOROTOR)]
    assert find_present(rows, folders, VARIED, None, None, Grades("a")).flight == "a"


def test_where_none_counts_the_newest_real_flight_stands(folders: dict[str, Path]) -> None:
    rows = [row("a", "2026-05-01"), row("b", "2026-05-02"), row("c", "2026-05-03", vehicle=SITL)]
    assert find_present(rows, folders, VARIED, None, None, Grades("c")).flight == "b"


def test_no_replay_is_asked_for_where_all_flights_have_the_same_values(folders: dict[str, Path]) -> None:
    rows = [row(name, f"2026-05-0{day}") for day, name in enumerate("abc", 1)]
    counts = Grades()
    present = find_present(rows, folders, ["EKF2_ACC_NOISE"], None, None, counts)
    assert (present.flight, present.same, counts.asked) == ("c", ("c", "b", "a"), [])


def test_a_log_without_flight_is_passed_over(folders: dict[str, Path]) -> None:
    rows = [row("a", "2026-05-01"), row("b", "2026-05-02", airborne_s=0.0)]
    assert find_present(rows, folders, VARIED, None).flight == "a"


@pytest.mark.parametrize("asked", [OCTOROTOR.name, "px4_fmu_v5", OCTOROTOR.uuid[:6]])
def test_another_vehicle_can_be_asked_for(folders: dict[str, Path], asked: str) -> None:
    rows = [row("a", "2026-05-01", vehicle=OCTOROTOR), row("b", "2026-05-02"), row("c", "2026-05-03")]
    present = find_present(rows, folders, VARIED, None, asked)
    assert (present.flight, present.same) == ("a", ("a",))


def test_a_vehicle_that_is_not_there_is_told_with_those_that_are(folders: dict[str, Path]) -> None:
    rows = [row("a", "2026-05-01", vehicle=OCTOROTOR), row("b", "2026-05-02")]
    with pytest.raises(UserError, match=rf"'V9' has no flight.*{QUADROTOR.name}, {OCTOROTOR.name}"):
        find_present(rows, folders, VARIED, None, "V9")


def test_a_name_that_several_vehicles_have_is_told(folders: dict[str, Path]) -> None:
    rows = [row("a", "2026-05-01", vehicle=OCTOROTOR), row("b", "2026-05-02")]
    with pytest.raises(UserError, match=r"'PX4_FMU' can mean .*Write more of its name"):
        find_present(rows, folders, VARIED, None, "PX4_FMU")


def test_a_flight_of_another_vehicle_cannot_be_asked_for_with_it(folders: dict[str, Path]) -> None:
    rows = [row("a", "2026-05-01", vehicle=OCTOROTOR), row("b", "2026-05-02")]
    with pytest.raises(UserError, match="'b' is no flight of PX4_FMU_V5 that can be replayed"):
        find_present(rows, folders, VARIED, "b", "PX4_FMU_V5")


@pytest.mark.parametrize("text", ["", "[]", '{"flight": "a"}', '{"flight": 1, "other": 2}'])
def test_a_damaged_file_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "present.json").write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=r"present\.json.*run the pipeline again"):
        read_present(tmp_path / "present.json")


STUDY = {"low": {"EKF2_ACC_NOISE": 0.2}, "other": {"EKF2_GPS_V_NOISE": 0.5, "EKF2_ACC_NOISE": 0.3}}


def test_every_flight_is_replayed_with_present_study_and_as_flown_of_which_the_last_is_not_scored() -> None:
    sets = FlightSets(STUDY)
    assert sets.scored == ["present", "low", "other"]
    assert sets.replayed == ["present", "low", "other", "as_flown"]
    assert sets.varied == ["EKF2_ACC_NOISE", "EKF2_GPS_V_NOISE"]


def test_present_gives_what_flies_now_and_as_flown_leaves_each_log_as_it_is() -> None:
    sets, present = FlightSets(STUDY), {"EKF2_ACC_NOISE": 0.35}
    values = sets.overrides(sets.replayed, present)
    assert values == {"present": present, **STUDY, "as_flown": {}}
    assert sets.overrides(["other"], {}) == {"other": STUDY["other"]}


def test_no_study_can_name_a_set_as_these_are_called() -> None:
    assert {PRESENT, AS_FLOWN} <= {*RESERVED_SET_NAMES}


def test_sets_with_mended_delays_are_the_sets_but_for_the_delay() -> None:
    sets = FlightSets({"quiet": {"EKF2_ACC_NOISE": 0.2}, "late": {"EKF2_GPS_DELAY": 150.0}})
    assert sets.mendable == [PRESENT, "quiet"]  # a set that varies a delay is left as it is
    mended = sets.mended(sets.mendable, {"EKF2_ACC_NOISE": 0.35, "EKF2_GPS_DELAY": 110.0}, {"EKF2_GPS_DELAY": 200.0})
    assert mended == {
        "delay_mended": {"EKF2_ACC_NOISE": 0.35, "EKF2_GPS_DELAY": 200.0},
        "quiet+delay_mended": {"EKF2_ACC_NOISE": 0.2, "EKF2_GPS_DELAY": 200.0},
    }
    assert "delay_mended" in RESERVED_SET_NAMES
    described = sets.described({"quiet": "less noise", "late": ""})
    assert described["quiet+delay_mended"] == "less noise, delays mended"
    assert described["delay_mended"] == "the configuration that flies now, delays mended"


def test_of_sets_with_equal_values_the_first_alone_is_mended() -> None:
    values = {"EKF2_ACC_NOISE": 0.2, "EKF2_GYR_NOISE": 0.01}
    sets = FlightSets({"a": values, "b": values | {"EKF2_ACC_NOISE": 0.3}, "a_again": dict(reversed(values.items()))})
    assert sets.mendable == [PRESENT, "a", "b"]
    assert sets.scored == [PRESENT, "a", "b", "a_again"]
