from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks.upload_trials.made_decision import NEW, UUID, write_decision

from fusetune.apply.upload.conversation import Station
from fusetune.apply.upload.judged import Judged, read_judged
from fusetune.apply.upload.refusals import refuse_changed, refuse_flying, refuse_foreign, refuse_timeless
from fusetune.apply.upload.stops import Refusal
from fusetune.apply.upload.values import Value
from fusetune.apply.upload.vehicles import Identity
from fusetune.errors import UserError

VEHICLE = Identity(1, 1, UUID, "v1.16.0", "0123456789", "bytewise")


def test_what_cannot_be_uploaded_says_why(tmp_path: Path) -> None:
    file = write_decision(tmp_path)
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("EKF2_GPS_DELAY\t40.0", "EKF2_GPS_DELAY\t41.0"), encoding="utf-8")
    with pytest.raises(UserError, match="no longer as the decision"):
        read_judged(file)
    (tmp_path / "alone").mkdir()
    (tmp_path / "alone" / "best_params.params").write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match="for which vehicle"):
        read_judged(tmp_path / "alone" / "best_params.params")
    simulated = write_decision(tmp_path / "own", kind="SITL", hardware="FUSETUNE_SIM")
    with pytest.raises(UserError, match="only fusetune simulated"):
        read_judged(simulated)


def judged(folder: Path, **vehicle: str) -> Judged:
    return read_judged(write_decision(folder, **vehicle))


@pytest.mark.parametrize(
    ("vehicle", "made_for", "reason"),
    [
        ({}, {}, None),
        ({}, {"uuid": "ff" * 18}, "another vehicle"),
        ({}, {"uuid": ""}, "do not tell which vehicle"),
        ({"uuid": ""}, {}, "does not tell its id"),
        ({"release": "v1.16.1"}, {}, "runs PX4 v1.16.1"),
        ({"release": "v1.16.0-beta"}, {}, "runs PX4 v1.16.0-beta"),
        ({}, {"release": "unknown"}, "flights were of unknown"),
        ({"uuid": "1006" + "0" * 32}, {"uuid": "", "kind": "SITL", "hardware": "PX4_SITL"}, None),
        ({}, {"uuid": "", "kind": "SITL", "hardware": "PX4_SITL"}, "do not tell which vehicle"),
    ],
)
def test_only_the_vehicle_and_release_of_the_logs_are_written_to(
    tmp_path: Path, vehicle: dict[str, str], made_for: dict[str, str], reason: str | None
) -> None:
    identity = Identity(**{**vars(VEHICLE), **vehicle})
    if reason is None:
        refuse_foreign(judged(tmp_path, **made_for), identity)
        return
    with pytest.raises(Refusal, match=reason):
        refuse_foreign(judged(tmp_path, **made_for), identity)


def test_only_values_that_were_judged_are_changed(tmp_path: Path) -> None:
    """One unit in the last place of a float32 is another value."""
    asked = judged(tmp_path)
    present = dict(asked.present)
    refuse_changed(asked, present)
    other = "EKF2_HEAD_NOISE"
    assert other not in NEW
    present[other] = Value("FLOAT", present[other].bits + 1)
    with pytest.raises(Refusal, match=f"not those that were judged: {other}"):
        refuse_changed(asked, present)
    del present["EKF2_GPS_DELAY"]
    with pytest.raises(Refusal, match="no parameter EKF2_GPS_DELAY"):
        refuse_changed(asked, present)
    present["EKF2_GPS_DELAY"] = Value.of("INT32", 110)
    with pytest.raises(Refusal, match="EKF2_GPS_DELAY is an INT32 on the vehicle"):
        refuse_changed(asked, present)


@pytest.mark.parametrize(
    ("armed", "landed", "reason"),
    [(True, 1, "is armed"), (False, 2, "in the air"), (False, 0, "does not say"), (False, None, "does not say")],
)
def test_a_vehicle_is_written_to_on_the_ground_alone(armed: bool, landed: int | None, reason: str) -> None:
    """MAV_LANDED_STATE: 0 undefined, 1 on the ground, 2 in the air."""
    with pytest.raises(Refusal, match=reason):
        refuse_flying(Station(None, 1, 1, 2, 12, armed, 0.0, landed=landed))
    refuse_flying(Station(None, 1, 1, 2, 12, False, 0.0, landed=1))


def test_a_vehicle_whose_reboot_would_pass_unnoticed_is_not_written_to() -> None:
    with pytest.raises(Refusal, match="a reboot would not be noticed"):
        refuse_timeless(Station(None, 1, 1, 2, 12, False, 0.0, landed=1))
    refuse_timeless(Station(None, 1, 1, 2, 12, False, 0.0, landed=1, booted_s=-100.0))
