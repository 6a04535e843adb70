"""What is told of a flight in one job: what is up to date stays as it is, and shared work changes nothing."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from fusetune.analyze.diagnose_flight import estimate_delays
from fusetune.analyze.flight_files import DELAYS_FILE
from fusetune.analyze.tell_flight import CONFORMANCE, DELAYS, DIAGNOSIS, Asked, tell_flight
from fusetune.px4.flight import Flight
from fusetune.px4.ulog.writer import write_ulog
from fusetune.save.log_folder import save_log
from fusetune.storage.documents import read_document

OWN: dict[str, float] = {}
OTHER = {"EKF2_GPS_DELAY": 60.0}


def test_only_what_is_out_of_date_is_told_again(survey_flight: Flight, project_root: Path, tmp_path: Path) -> None:
    log, saved, folder = (tmp_path / name for name in ("survey.ulg", "save/survey", "analyze"))
    write_ulog(log, survey_flight)
    save_log(log, saved)
    mission = Path(shutil.copy(project_root / "config/missions/survey.yaml", tmp_path))
    asked = Asked(OWN, (mission,), code={DIAGNOSIS: "a", DELAYS: "a", CONFORMANCE: "a"})

    assert tell_flight(saved, folder, asked) == (DIAGNOSIS, DELAYS, CONFORMANCE)
    shared = read_document(folder / DELAYS_FILE)
    assert tell_flight(saved, folder, asked) == ()

    # by another replay than the diagnosis's, the delay of the receiver is what it was: what is told does not matter
    assert tell_flight(saved, folder, replace(asked, present=OTHER)) == (DELAYS,)
    (gnss,) = (one for one in read_document(folder / DELAYS_FILE)["delays"] if one["sensor"] == "gnss")
    (flown,) = (one for one in shared["delays"] if one["sensor"] == "gnss")
    assert (gnss["told_ms"], flown["told_ms"]) == (60.0, survey_flight.parameters.initial["EKF2_GPS_DELAY"])
    assert abs(gnss["value_ms"] - flown["value_ms"]) < gnss["standard_error_ms"]
    # alone, with a replay of its own, the job finds the same as beside the diagnosis
    estimate_delays(saved, folder, OWN)
    assert read_document(folder / DELAYS_FILE) == shared

    # that file is not the one of the ledger any more, and the mission another
    mission.write_text(mission.read_text(encoding="utf-8") + "\n# another one\n", encoding="utf-8")
    assert tell_flight(saved, folder, replace(asked, present=OTHER)) == (DELAYS, CONFORMANCE)


def test_a_log_that_cannot_be_read_tells_no_delays(tmp_path: Path) -> None:
    log, saved, folder = (tmp_path / name for name in ("broken.ulg", "save/broken", "analyze"))
    log.write_bytes(b"no log at all")
    save_log(log, saved)
    assert tell_flight(saved, folder, Asked(OWN)) == (DIAGNOSIS, DELAYS, CONFORMANCE)
    assert read_document(folder / DELAYS_FILE)["delays"] == []
