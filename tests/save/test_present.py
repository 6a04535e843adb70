from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from fusetune.errors import UserError
from fusetune.save import FlightSets, Present, find_present, flight_folder, read_present, write_present
from fusetune.set_names import AS_FLOWN, PRESENT, RESERVED_SET_NAMES
from fusetune.storage.documents import write_document

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


def row(flight: str, recorded: str, status: str = "replayable") -> dict[str, Any]:
    return {"flight": flight, "recorded": recorded, "status": status}


def test_the_newest_flight_that_can_be_replayed_is_present(folders: dict[str, Path]) -> None:
    rows = [row("c", "2026-05-03", "refused"), row("b", "2026-05-02"), row("a", "2026-05-01")]
    present = find_present(rows, folders, VARIED, None)
    assert present == Present("b", "sum of b", {"EKF2_ACC_NOISE": 0.35, "EKF2_GPS_V_NOISE": 0.1})


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
    present = Present("a", "0123", {"EKF2_ACC_NOISE": 0.1, "EKF2_GPS_V_NOISE": 1 / 3})
    write_present(tmp_path / "present.json", present)
    assert read_present(tmp_path / "present.json") == present


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
