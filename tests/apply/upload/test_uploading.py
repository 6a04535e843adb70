"""Uploads to a vehicle in a process of its own, over loopback, with times twenty times as fast.

What stands on the vehicle afterwards the vehicle itself tells. A tenth of all messages is lost each way unless a test
says otherwise; `benchmarks/upload_trials` tries the same many times.
"""

from __future__ import annotations

import errno
import os
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest
from benchmarks.upload_trials.made_decision import NEW, made_values, old_and_new, write_decision
from benchmarks.upload_trials.running import RunningVehicle, vehicle_running
from benchmarks.upload_trials.trials import PACE, try_upload

from fusetune.apply.upload.backup import read_backup
from fusetune.apply.upload.journal import Journal, read_journal
from fusetune.apply.upload.pace import Pace
from fusetune.apply.upload.stops import Refusal
from fusetune.apply.upload.transcript import Transcript
from fusetune.apply.upload.uploading import Asked, Outcome, Upload
from fusetune.errors import UserError

VALUES = made_values(200)
LOSSY = {"loss": 0.1, "double": 0.05, "delay_s": (0.0, 0.008)}
FIRST, *_, LAST = NEW


class Told:
    """An upload, and what its pilot is told and answers."""

    def __init__(self, running: RunningVehicle, folder: Path, answer: bool = True, **more: Any) -> None:
        self.lines: list[str] = []
        self.questions: list[str] = []
        self._answer = answer
        more = {"pace": Pace(patience_s=20.0).times(PACE)} | more
        transcript = Transcript(self.lines.append)
        self.upload = Upload(Asked(running.address, folder / "uploads", self._ask, transcript, **more))

    def _ask(self, question: str, meanwhile: Any) -> bool:
        self.questions.append(question)
        meanwhile()
        return self._answer

    @property
    def text(self) -> str:
        return "\n".join(self.lines)


def stands(report: dict[str, Any]) -> set[str]:
    """Which values the vehicle holds, and has saved: "old", "new"."""
    found = set()
    for name, (old, new) in old_and_new().items():
        assert report["values"][name] == report["saved"][name]
        found.add({old: "old", new: "new"}[report["values"][name]])
    others = {name: bits for name, (_, bits) in VALUES.items() if name not in NEW}
    assert others.items() <= report["values"].items()
    return found


def test_values_are_shown_backed_up_written_and_read_back_and_taken_back_on_demand(tmp_path: Path) -> None:
    file = write_decision(tmp_path / "apply")
    with vehicle_running({"values": VALUES}, others=True, pace=PACE, **LOSSY) as running:
        no = Told(running, tmp_path, answer=False)
        assert no.upload.new(file) is Outcome.NOTHING
        told = Told(running, tmp_path)
        assert told.upload.new(file) is Outcome.WRITTEN
        again = Told(running, tmp_path)
        assert again.upload.new(file) is Outcome.NOTHING
        folder = told.upload.folder
        assert folder is not None
        back = Told(running, tmp_path)
        assert back.upload.rollback(folder) is Outcome.WRITTEN
        [report] = running.reports()
    assert "has these values already" in again.text
    assert no.questions == told.questions == ["Write 8 values to the vehicle?"]
    [row] = [line for line in told.text.splitlines() if line.startswith("  EKF2_GPS_DELAY")]
    assert row.split() == ["EKF2_GPS_DELAY", "110", "40", "ms", "0", "…", "300", "after", "a", "reboot"]
    assert "All 200 parameters are kept in" in told.text
    assert "Done: 8 values written, saved and read back." in told.text
    assert "says that nothing else has changed" in told.text
    assert "EKF2_GPS_DELAY, EKF2_HGT_REF take effect after a reboot" in told.text
    backup = {name: (value.type, value.bits) for name, value in read_backup(folder / "backup.params").values.items()}
    assert backup == VALUES
    assert read_journal(folder).ended == "new"
    transcript = (folder / "transcript.txt").read_text(encoding="utf-8")
    assert f"PARAM_SET param_id={FIRST} param_value=0x{old_and_new()[FIRST][1]:08x}" in transcript
    assert stands(report) == {"old"}
    for name, values in old_and_new().items():
        assert set(report["history"][name]) == set(values)


@pytest.mark.parametrize(
    ("faults", "traits", "reason"),
    [
        ({"armed": True}, {}, "the vehicle is armed; nothing was written"),
        ({}, {"uid": "0002" * 9}, "this is another vehicle than that of the logs"),
        ({}, {"version": 0x010F04FF}, "the vehicle runs PX4 v1.15.4, and the flights were of v1.16.0"),
    ],
)
def test_nothing_is_sent_to_a_vehicle_that_is_not_the_one_or_not_on_the_ground(
    tmp_path: Path, faults: dict[str, Any], traits: dict[str, Any], reason: str
) -> None:
    file = write_decision(tmp_path / "apply")
    with vehicle_running({"values": VALUES, "faults": faults, **traits}, pace=PACE) as running:
        told = Told(running, tmp_path)
        with pytest.raises(Refusal, match=reason):
            told.upload.new(file)
        [report] = running.reports()
    assert report["sets"] == []
    assert told.questions == []


def test_of_several_vehicles_only_the_one_that_is_meant_is_written_to(tmp_path: Path) -> None:
    """Two have the id that the decision is for, as their boards would not; what tells them apart is the system id."""
    file = write_decision(tmp_path / "apply")
    fleet = [{"values": VALUES, "system": system} for system in (1, 2)]
    with vehicle_running(*fleet, others=True, pace=PACE) as running:
        with pytest.raises(Refusal, match=r"several vehicles: system 1 at .*, system 2 at .*Say which with --system"):
            Told(running, tmp_path).upload.new(file)
        with pytest.raises(Refusal, match="no vehicle with system id 3"):
            Told(running, tmp_path, system=3).upload.new(file)
        assert Told(running, tmp_path, system=2).upload.new(file) is Outcome.WRITTEN
        first, second = running.reports()
    assert first["sets"] == []
    assert stands(second) == {"new"}


def test_a_reboot_that_loses_what_was_not_saved_is_noticed_and_all_is_written_again() -> None:
    trial = try_upload(3, faults={"reboot_after_sets": 4})
    assert (trial.outcome, trial.reboots, trial.wrong) == ("written", 1, [])
    assert "The vehicle has rebooted meanwhile: all values are read again." in trial.told


def test_what_comes_back_after_a_reboot_as_another_vehicle_gets_nothing(tmp_path: Path) -> None:
    file = write_decision(tmp_path / "apply")
    faults = {"reboot_after_sets": 3, "exchanged": True}
    with vehicle_running({"values": VALUES, "faults": faults}, pace=PACE, **LOSSY) as running:
        told = Told(running, tmp_path)
        assert told.upload.new(file) is Outcome.UNFINISHED
        [report] = running.reports()
    assert report["reboots"] == 1
    assert {one["uid"] for one in report["sets"]} == {"00010000000020343457544e5015003a0043"}
    assert "Not finished: another vehicle answers now" in told.text
    assert f"{LAST}: 0.05, the old value" in told.text


def test_a_vehicle_that_arms_midway_gets_no_more_and_its_old_values_when_it_is_disarmed() -> None:
    trial = try_upload(5, faults={"arm_after_sets": 3, "disarm_after_s": 20.0})
    assert (trial.outcome, trial.sets_while_armed, trial.wrong) == ("taken back", 0, [])
    told = "\n".join(trial.told)
    assert "The vehicle is armed. Writing stops; what was written is taken back. What stands now:" in told
    assert "Waiting until it is disarmed." in told


def test_a_value_that_is_not_taken_takes_all_back_and_the_vehicles_reason_is_told() -> None:
    trial = try_upload(6, faults={"refused": 0.01, "refused_name": LAST, "error": True})
    assert (trial.outcome, trial.wrong) == ("taken back", [])
    told = "\n".join(trial.told)
    assert f"The vehicle does not take {LAST} = 0.03 (" in told
    assert "value out of range" in told


def test_saving_that_is_not_confirmed_takes_all_back(tmp_path: Path) -> None:
    file = write_decision(tmp_path / "apply")
    with vehicle_running({"values": VALUES, "faults": {"no_save_ack": True}}, pace=PACE) as running:
        told = Told(running, tmp_path, pace=Pace(attempts=3).times(PACE))
        assert told.upload.new(file) is Outcome.TAKEN_BACK
        [report] = running.reports()
    assert "The vehicle does not answer: that it saves its parameters." in told.text
    assert (
        "All values that were written are as they were before, read back.\nIt is not confirmed that they are saved"
        in told.text
    )
    assert len(report["sets"]) == 2 * len(NEW)
    assert stands(report) == {"old"}


def test_who_else_writes_meanwhile_is_told_and_left_what_he_wrote(tmp_path: Path) -> None:
    file = write_decision(tmp_path / "apply")
    faults = {"meddle_after_sets": 2, "meddled": LAST}
    with vehicle_running({"values": VALUES, "faults": faults}, pace=PACE) as running:
        told = Told(running, tmp_path)
        assert told.upload.new(file) is Outcome.TAKEN_BACK
        [report] = running.reports()
    assert f"Somebody else has changed {LAST}: 0.123, before 0.05." in told.text
    meddled = report["values"].pop(LAST)
    assert meddled not in old_and_new()[LAST]
    assert all(report["values"][name] == old for name, (old, _) in old_and_new().items() if name != LAST)


def test_a_link_that_is_gone_for_good_ends_with_what_is_known_and_is_gone_on_with(tmp_path: Path) -> None:
    file = write_decision(tmp_path / "apply")
    faults = {"silent_after_sets": 4, "silent_s": 45.0}
    with vehicle_running({"values": VALUES, "faults": faults}, pace=PACE, **LOSSY) as running:
        told = Told(running, tmp_path)
        assert told.upload.new(file) is Outcome.UNFINISHED
        with pytest.raises(Refusal, match=r"is not finished.*--resume"):
            Told(running, tmp_path).upload.new(file)
        again = Told(running, tmp_path)
        assert again.upload.resume(None) is Outcome.WRITTEN
        with pytest.raises(UserError, match="has ended, with all new values"):
            Told(running, tmp_path).upload.resume(told.upload.folder)
        [report] = running.reports()
    assert f"{FIRST}: 0.7, the new value, as last read" in told.text
    assert f"{LAST}: 0.05, the old value: nothing was sent" in told.text
    assert "not known: " in told.text
    assert f"--resume --folder {told.upload.folder}" in told.text
    assert again.questions == ["Go on, until all new values stand?"]
    assert stands(report) == {"new"}


def test_an_upload_whose_process_dies_is_gone_on_with_or_taken_back(tmp_path: Path) -> None:
    trial = try_upload(8, killed_at=9)
    assert (trial.outcome, trial.resumed, trial.wrong) == ("written", 1, [])


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (KeyboardInterrupt(), "Interrupted. What is known"),
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), "The journal cannot be written (No space left on device)"),
    ],
)
def test_ctrl_c_and_a_full_disk_end_with_what_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException, said: str
) -> None:
    write, lines = Journal.write, iter(range(100))

    def failing(journal: Journal, event: str, **details: Any) -> None:
        if next(lines) == 5:
            raise error
        write(journal, event, **details)

    monkeypatch.setattr(Journal, "write", failing)
    file = write_decision(tmp_path / "apply")
    with vehicle_running({"values": VALUES}, pace=PACE) as running:
        told = Told(running, tmp_path)
        with pytest.raises(KeyboardInterrupt) if isinstance(error, KeyboardInterrupt) else nullcontext():
            assert told.upload.new(file) is Outcome.UNFINISHED
        [report] = running.reports()
    # planned, two parameters sent and verified, the third about to be sent
    assert len(report["sets"]) == 2
    assert said in told.text
    assert f"{FIRST}: 0.7, the new value, as last read" in told.text
    assert "EKF2_GPS_CHECK: 1023, the old value, as last read" in told.text
    assert "--resume" in told.text


def test_what_was_not_finished_may_be_taken_back_instead(tmp_path: Path) -> None:
    """Then it has ended, and a new upload may begin."""
    file = write_decision(tmp_path / "apply")
    faults = {"silent_after_sets": 2, "silent_s": 30.0}
    with vehicle_running({"values": VALUES, "faults": faults}, pace=PACE) as running:
        told = Told(running, tmp_path, pace=Pace(patience_s=5.0).times(PACE))
        assert told.upload.new(file) is Outcome.UNFINISHED
        folder = told.upload.folder
        assert folder is not None
        back = Told(running, tmp_path)
        assert back.upload.rollback(folder) is Outcome.WRITTEN
        assert read_journal(folder).ended == "old"
        assert Told(running, tmp_path).upload.new(file) is Outcome.WRITTEN
        [report] = running.reports()
    assert back.questions == ["Write 2 values to the vehicle?"]
    assert stands(report) == {"new"}


@pytest.mark.parametrize("way", ["tcp", "pty"])
def test_tcp_that_breaks_and_a_serial_line_carry_it_too(tmp_path: Path, way: str) -> None:
    """With the other encoding, and a vehicle that knows no MAV_CMD_REQUEST_MESSAGE, as before v1.12."""
    if way == "pty":
        pytest.importorskip("serial", reason="needs pyserial, of the extra `upload`")
    file = write_decision(tmp_path / "apply")
    small = {name: one for name, one in VALUES.items() if one[0] == "FLOAT" or name.startswith("EKF2")}
    vehicle = {"values": small, "cast": way == "tcp", "faults": {"no_request_message": True}}
    with vehicle_running(vehicle, way=way, pace=PACE, dropped_s=0.9) as running:
        told = Told(running, tmp_path)
        assert told.upload.new(file) is Outcome.WRITTEN
        [report] = running.reports()
    assert {report["saved"][name] for name in NEW} == {new for _, new in old_and_new().values()}
