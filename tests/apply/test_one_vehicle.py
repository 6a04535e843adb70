"""One decision per vehicle: whose flights decide, and what is told of the others."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.analyze.made_flight import MadeSet
from tests.apply.study import make_study

from fusetune.apply.decide import decide
from fusetune.apply.evidence import OTHER_VEHICLE, read_flights
from fusetune.apply.one_vehicle import DecidedVehicle, decided_vehicle
from fusetune.apply.settings import DecisionSettings
from fusetune.px4.vehicle_identity import VehicleIdentity
from fusetune.storage.documents import write_document

QUADROTOR = VehicleIdentity("0001" + "0" * 28 + "003a", "PX4_FMU_V4", "4011", "quadrotor")
OCTOROTOR = VehicleIdentity("0002" + "0" * 28 + "002d", "PX4_FMU_V5", "8001", "octorotor")
SITL = VehicleIdentity("", "PX4_SITL", "4001", "quadrotor", "SITL")
SETS = {"present": MadeSet(error=0.13), "better": MadeSet(error=0.1, overrides={"EKF2_ACC_NOISE": 0.2})}
FLOWN_BY = (QUADROTOR, QUADROTOR, OCTOROTOR, QUADROTOR, SITL)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Path], Path]:
    """Five flights of three vehicles."""
    return make_study(tmp_path_factory.mktemp("vehicles"), SETS, 5, vehicles=FLOWN_BY)


def decision_of(study: tuple[list[Path], Path], output: Path, **options: Any) -> dict[str, Any]:
    decide(*study, output, sets=list(SETS), **options)
    return json.loads((output / "decision.json").read_text(encoding="utf-8"))


def test_flights_of_others_have_no_say_and_are_told_by_name(study: tuple[list[Path], Path], tmp_path: Path) -> None:
    decision = decision_of(study, tmp_path, newest_flight="flight_3")
    assert decision["flights_scored"] == 3
    assert {row["flight"] for row in decision["flights"] if row["scored"]} == {"flight_0", "flight_1", "flight_3"}
    reasons = {row["flight"]: row["reason"] for row in decision["flights"] if not row["scored"]}
    assert reasons == {
        "flight_2": "it is of another vehicle (octorotor PX4_FMU_V5-0000002d-8001)",
        "flight_4": "it is of another vehicle (simulated (SITL) quadrotor PX4_SITL-4001)",
    }
    assert (
        "This is for the quadrotor PX4_FMU_V4-0000003a-4011. Left out, as they are of other vehicles: flight_2 "
        "(octorotor PX4_FMU_V5-0000002d-8001); flight_4 (simulated (SITL) quadrotor PX4_SITL-4001); set `vehicle` to "
        "PX4_FMU_V5-0000002d-8001 or PX4_SITL-4001 to decide for that."
    ) in decision["paragraph"]
    assert decision["vehicle"]["left_out"] == {"flight_2": OCTOROTOR.name, "flight_4": SITL.name}
    assert decision["vehicle"]["flights"] == ["flight_0", "flight_1", "flight_3"]


def test_the_decision_is_that_of_its_flights_alone(study: tuple[list[Path], Path], tmp_path: Path) -> None:
    folders, table = study
    mixed = decision_of(study, tmp_path / "mixed", newest_flight="flight_3")
    own = [folder for folder in folders if folder.name in ("flight_0", "flight_1", "flight_3")]
    alone = decision_of((own, table), tmp_path / "alone", newest_flight="flight_3")
    for name in ("ranking", "weights", "leave_one_out", "changes", "noises", "paper_mode"):
        assert mixed[name] == alone[name], name


def test_the_parameter_files_name_vehicle_and_flight(study: tuple[list[Path], Path], tmp_path: Path) -> None:
    decision_of(study, tmp_path, newest_flight="flight_2")
    for name in ("best_params.params", "rollback.params"):
        head = (tmp_path / name).read_text(encoding="utf-8")
        assert "# for the octorotor PX4_FMU_V5-0000002d-8001\n" in head
        assert "# previous values from flight flight_2, firmware" in head


def test_a_decision_on_simulated_flights_says_so(study: tuple[list[Path], Path], tmp_path: Path) -> None:
    decision = decision_of(study, tmp_path, newest_flight="flight_4")
    assert "This is for a simulated vehicle (simulated (SITL) quadrotor PX4_SITL-4001)" in decision["paragraph"]


def test_nothing_is_said_where_one_vehicle_flew_all(study: tuple[list[Path], Path], tmp_path: Path) -> None:
    folders, table = study
    decision = decision_of((folders[:2], table), tmp_path, newest_flight="flight_1")
    assert "vehicle" not in decision["paragraph"]


def test_many_other_vehicles_are_told_shortly() -> None:
    others = {
        f"flight_{number}": VehicleIdentity(f"{number:032d}", "PX4_FMU_V6C", "4001", "quadrotor") for number in range(6)
    }
    (_, text) = DecidedVehicle(QUADROTOR, others).sentences()
    assert (
        "flight_3 (quadrotor PX4_FMU_V6C-00000003-4001); and 2 more of 2 vehicles; set `vehicle` to a name in" in text
    )
    assert "flight_4" not in text


GRADE_D = {"grade": "D", "trust": {"is_compared": True, "reason": "heading differs by 90°"}}


def test_where_the_newest_flight_does_not_count_one_with_the_same_values_stands_for_it(
    tmp_path: Path,
) -> None:
    folders, table = make_study(tmp_path, SETS, 3)
    write_document(folders[2] / "fidelity.json", GRADE_D)
    options = {"newest_flight": "flight_2", "same_present": ["flight_2", "flight_1"]}
    decision = decision_of((folders, table), tmp_path / "apply", **options)
    assert decision["newest_flight"] == decision["vehicle"]["present_flight"] == "flight_1"
    assert "set `present_flight`" not in decision["paragraph"]
    # with no other flight that has these values it is told, with what can be done
    decision = decision_of((folders, table), tmp_path / "apply", newest_flight="flight_2", same_present=["flight_2"])
    assert decision["newest_flight"] == "flight_2"
    assert (
        "What flies now is known from flight_2 alone, which has no say itself (its replay has" in decision["paragraph"]
    )
    assert "set `present_flight` to a flight that counts" in decision["paragraph"]


def test_how_white_a_source_usually_is_comes_from_flights_of_the_vehicle(study: tuple[list[Path], Path]) -> None:
    folders, table = study
    vehicle = decided_vehicle(table, [folder.name for folder in folders], "flight_2")
    assert set(vehicle.others) == {"flight_0", "flight_1", "flight_3", "flight_4"}
    without = vehicle.without("flight_0")
    assert without is not None
    assert without.kind == OTHER_VEHICLE
    assert vehicle.without("flight_2") is None
    (alone,) = read_flights([folders[2]], DecisionSettings(), "present")
    assert alone.evidence is not None
    assert np.isfinite(alone.evidence.scores).all()
