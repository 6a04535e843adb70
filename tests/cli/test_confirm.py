"""The log of a replay, read back.

PX4's replay is no package, so the logs are those of a simulated vehicle: the same flight once more, sample by sample,
with another parameter set in the estimator on board, which is what PX4's replay logs.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fusetune.apply.replayed_log.comparison import compare_replayed
from fusetune.cli import main
from fusetune.design.missions.mission import load_mission
from fusetune.errors import UserError
from fusetune.execute.simulation import simulate
from fusetune.execute.vehicle import load_vehicle
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.line_files import write_replay_params
from fusetune.px4.parameters.params_file import ParamEntry
from fusetune.px4.ulog.reader import read_ulog

NEW = {"EKF2_ACC_NOISE": 0.8, "EKF2_GPS_DELAY": 40.0}


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory, project_root: Path) -> Path:
    """A flight, the same replayed with other parameters, and what the replay was given."""
    folder = tmp_path_factory.mktemp("logs")
    mission = load_mission(project_root / "config/missions/short_survey.yaml")
    vehicle = load_vehicle(project_root / "config/vehicles/mistuned_quadrotor.yaml")
    for name, parameters, seed in (("flown", {}, 3), ("replayed", NEW, 3), ("other", {}, 4)):
        simulate(mission, vehicle, parameters, seed, (), folder / f"{name}.ulg")
    write_replay_params(folder / "replay_params.txt", [ParamEntry(name, value, "FLOAT") for name, value in NEW.items()])
    return folder


def test_a_replay_that_ran_as_asked_bears_the_prediction_out(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["confirm", str(logs / "flown.ulg"), str(logs / "replayed.ulg")]
    assert main([*arguments, "--asked", str(logs / "replay_params.txt")]) == 0
    said = capsys.readouterr().out
    assert said.startswith("PX4's replay bears out what was predicted")
    assert "EKF2_GPS_DELAY 110 -> 40, as asked" in said
    found = compare_replayed(logs / "flown.ulg", logs / "replayed.ulg")
    errors = {(one.source, one.axis): one for one in found.errors}
    # the receiver delivers after 40 ms, so velocity errors must shrink, as seen and as predicted
    for axis in range(2):
        assert errors["gnss_vel", axis].change < -0.1
        assert errors["gnss_vel", axis].predicted_change < -0.1
    # RMS by hand from the log itself: of all in the air, which the compared ones are but for the first seconds
    flight = canonical(read_ulog(logs / "flown.ulg"))
    table = flight.topic("estimator_aid_src_gnss_vel")
    assert table is not None
    late = table["timestamp_sample"] > 25e6 + table["timestamp_sample"][0]
    assert errors["gnss_vel", 0].before == pytest.approx(
        np.sqrt(np.mean(np.square(table["innovation[0]"][late].astype(float)))), rel=0.1
    )


def test_a_replay_with_other_parameters_or_of_another_flight_confirms_nothing(
    logs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["confirm", str(logs / "flown.ulg"), str(logs / "flown.ulg")]
    assert main([*arguments, "--asked", str(logs / "replay_params.txt")]) == 1
    said = capsys.readouterr().out
    assert said.startswith("The replay did not run with what was asked")
    assert "EKF2_ACC_NOISE 0.35 -> 0.35, asked was 0.8" in said
    # the simulator's clock is the same on all flights: what tells them apart is what the sensors say
    with pytest.raises(UserError, match=r"is no replay of flown\.ulg"):
        compare_replayed(logs / "flown.ulg", logs / "other.ulg")
