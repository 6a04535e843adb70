"""Uploads tried on an unkind vehicle, and whether what it holds afterwards is what the upload says."""

from __future__ import annotations

import random
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.upload_trials.made_decision import made_values, old_and_new, write_decision
from benchmarks.upload_trials.running import RunningVehicle, vehicle_running

from fusetune.apply.upload.journal import Journal
from fusetune.apply.upload.pace import Pace
from fusetune.apply.upload.stops import Refusal
from fusetune.apply.upload.transcript import Transcript
from fusetune.apply.upload.uploading import Asked, Outcome, Upload

PACE = 0.05
"""Factor of all times, the vehicle's and ours."""
PARAMETERS = 400
_MOST_RESUMED = 5


@dataclass
class Trial:
    """How one upload went.

    Attributes
    ----------
    outcome : "written", "taken back", "refused", "unfinished"
    sets, sets_while_armed : PARAM_SETs that reached the vehicle
    armed_s : how long it had been armed when the last of the latter came; 0 without one
    wrong : what is not as it should be; empty where all is well
    seconds : of the upload, by the vehicle's clock
    resumed : how often it was gone on with
    """

    outcome: str
    sets: int
    sets_while_armed: int
    reboots: int
    retries: int
    resumed: int
    seconds: float
    wrong: list[str]
    armed_s: float = 0.0
    told: list[str] = field(repr=False, default_factory=list)


class _Killed(BaseException):
    """The process ends here, as by a power cut."""


def try_upload(
    seed: int,
    *,
    loss: float = 0.1,
    faults: Mapping[str, Any] | None = None,
    killed_at: int = 0,
    traits: Mapping[str, Any] | None = None,
    again: bool = True,
    **settings: Any,
) -> Trial:
    """One upload to one vehicle, gone on with where it is not finished.

    Parameters
    ----------
    faults : of the vehicle
    killed_at : the upload's process dies at this line of its journal, and is gone on with; 0: never
    again : whether an unfinished one is gone on with
    """
    told: list[str] = []
    vehicle = {"values": made_values(PARAMETERS, seed), "faults": dict(faults or {}), **(traits or {})}
    air = {"loss": loss, "double": 0.05, "delay_s": (0.0, 0.16 * PACE)}
    with (
        tempfile.TemporaryDirectory() as folder,
        vehicle_running(vehicle, pace=PACE, seed=seed, others=True, **(air | settings)) as running,
    ):
        file = write_decision(Path(folder) / "decision")
        upload = _upload(running, Path(folder), told)
        begun_s = time.monotonic()
        outcome, retries, resumed = _first(upload, file, killed_at, told), upload.retries, 0
        while outcome == "unfinished" and again and resumed < _MOST_RESUMED:
            resumed += 1
            further = _upload(running, Path(folder), told)
            outcome = _said(lambda further=further: further.resume(upload.folder), told)  # type: ignore[misc]
            outcome = "unfinished" if outcome == "refused" else outcome
            retries += further.retries
        seconds = (time.monotonic() - begun_s) / PACE
        [report] = running.reports()
    sets = report["sets"]
    armed = sum(one["armed"] for one in sets)
    armed_s = max((one["armed_s"] for one in sets), default=0.0)
    wrong = _wrong(outcome, report, vehicle["values"])
    return Trial(outcome, len(sets), armed, report["reboots"], retries, resumed, seconds, wrong, armed_s, told)


def _upload(running: RunningVehicle, folder: Path, told: list[str]) -> Upload:
    pace = Pace(patience_s=60.0).times(PACE)
    return Upload(Asked(running.address, folder / "uploads", lambda *_: True, Transcript(told.append), pace=pace))


def _first(upload: Upload, file: Path, killed_at: int, told: list[str]) -> str:
    if not killed_at:
        return _said(lambda: upload.new(file), told)
    write, count = Journal.write, 0

    def dying(journal: Journal, event: str, **details: Any) -> None:
        nonlocal count
        write(journal, event, **details)
        count += 1
        if count == killed_at:
            raise _Killed

    Journal.write = dying  # type: ignore[method-assign]
    try:
        return _said(lambda: upload.new(file), told)
    except _Killed:
        return "unfinished"
    finally:
        Journal.write = write  # type: ignore[method-assign]


def _said(act: Callable[[], Outcome], told: list[str]) -> str:
    try:
        return act().value
    except Refusal as refusal:
        told.append(f"refused: {refusal}")
        return "refused"


def _wrong(outcome: str, report: Mapping[str, Any], before: Mapping[str, tuple[str, int]]) -> list[str]:
    """What the vehicle holds that it should not, or the upload says that is not so."""
    wrong, goals = [], old_and_new()
    for name, bits in report["values"].items():
        old, new = goals.get(name, (before[name][1], before[name][1]))
        expected = {"written": {new}, "taken back": {old}, "refused": {old}, "unfinished": {old, new}}[outcome]
        if bits not in expected or (outcome != "unfinished" and report["saved"][name] != bits):
            wrong.append(f"{outcome}: {name} holds {bits:08x}, saved {report['saved'][name]:08x}")
        if not set(report["history"].get(name, [])) <= {old, new}:
            wrong.append(f"{name} has held something else: {report['history'][name]}")
    return wrong


def lossy(seed: int) -> Trial:
    """A tenth of all messages is lost each way."""
    return try_upload(seed)


def rebooted(seed: int) -> Trial:
    """… and the vehicle reboots at one of the writes, or some time after the first."""
    chance = random.Random(seed)
    at_set = chance.random() < 0.5
    faults = {"reboot_after_sets": chance.randint(1, 8)} if at_set else {"reboot_at_s": chance.uniform(8.0, 20.0)}
    return try_upload(seed, faults=faults)


def interrupted(seed: int) -> Trial:
    """… and the link is gone from one of the writes on, for some time or for longer than it is waited for."""
    chance = random.Random(seed)
    faults = {"silent_after_sets": chance.randint(1, 8), "silent_s": chance.choice((15.0, 40.0, 150.0))}
    return try_upload(seed, faults=faults)


def killed(seed: int) -> Trial:
    """… and the upload's process dies at a line of its journal."""
    return try_upload(seed, killed_at=random.Random(seed).randint(2, 18))


def armed(seed: int) -> Trial:
    """The vehicle is armed from the start."""
    return try_upload(seed, faults={"armed": True})


def armed_midway(seed: int) -> Trial:
    """It arms when one of the writes arrives, and disarms later."""
    chance = random.Random(seed)
    return try_upload(seed, faults={"arm_after_sets": chance.randint(1, 7), "disarm_after_s": 30.0})


def armed_sometime(seed: int) -> Trial:
    """It arms at any time, so that a write may be under way."""
    chance = random.Random(seed)
    return try_upload(seed, faults={"arm_at_s": chance.uniform(14.0, 34.0), "disarm_after_s": 30.0})


def foreign(seed: int) -> Trial:
    """It is another vehicle."""
    return try_upload(seed, traits={"uid": f"0001{seed:032x}"})


def refusing(seed: int) -> Trial:
    """It keeps one parameter as it is, with and without PARAM_ERROR."""
    name = random.Random(seed).choice(["EKF2_MAG_NOISE", "EKF2_GYR_NOISE", "EKF2_GPS_DELAY"])
    return try_upload(seed, faults={"refused": 0.01, "refused_name": name, "error": seed % 2 == 0})


def killed_on_the_way_back(seed: int) -> Trial:
    """It keeps the last parameter as it is, and the upload's process dies while the others are taken back."""
    faults = {"refused": 0.01, "refused_name": "EKF2_MAG_NOISE"}
    return try_upload(seed, faults=faults, killed_at=random.Random(seed).randint(20, 36))


KINDS: Mapping[str, tuple[int, Callable[[int], Trial], frozenset[str]]] = {
    "10 % loss each way": (200, lossy, frozenset({"written"})),
    "and a reboot": (20, rebooted, frozenset({"written", "taken back"})),
    "and a lost link": (20, interrupted, frozenset({"written", "taken back"})),
    "and a killed upload": (20, killed, frozenset({"written", "taken back"})),
    "a refused value": (10, refusing, frozenset({"taken back"})),
    "killed on the way back": (10, killed_on_the_way_back, frozenset({"taken back"})),
    "armed": (25, armed, frozenset({"refused"})),
    "another vehicle": (25, foreign, frozenset({"refused"})),
    "arms at a write": (10, armed_midway, frozenset({"written", "taken back"})),
    "arms at any time": (20, armed_sometime, frozenset({"written", "taken back", "refused"})),
}
"""How often each kind is tried, how, and how it may end."""
