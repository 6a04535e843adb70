"""The log of a replay, read back.

PX4's replay is no package, so its logs are made: of a simulated flight, flown once more sample by sample with another
set in the estimator on board; and of a golden flight, with what PX4's own estimator computed on it.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from fusetune.apply.replayed_log.comparison import compare_replayed
from fusetune.cli import main
from fusetune.design.missions.mission import load_mission
from fusetune.errors import UserError
from fusetune.execute.onboard_estimator import estimator_topics
from fusetune.execute.simulation import simulate
from fusetune.execute.vehicle import load_vehicle
from fusetune.px4.aid_sources import MEASURED_SOURCES
from fusetune.px4.flight import TopicTable
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.line_files import write_replay_params
from fusetune.px4.parameters.params_file import ParamEntry
from fusetune.px4.ulog.reader import read_ulog
from fusetune.px4.ulog.writer import write_ulog

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


def test_px4s_own_figures_bear_our_prediction_out(golden_logs: Path, golden_reference: Path, tmp_path: Path) -> None:
    flown = read_ulog(golden_logs / "mc_drag.ulg")
    reference = golden_reference / "mc_drag"
    overrides = json.loads((reference / "aid.json").read_text())["overrides"]
    initial = flown.parameters.initial | {name: float(value) for name, value in overrides.items()}
    others = {key: table for key, table in flown.topics.items() if not key[0].startswith("estimator_")}
    before = replace(flown, topics=others | estimator_topics(canonical(flown)))
    again = replace(flown, topics=others | px4s_topics(reference / "aid.innovations.parquet"))
    again = replace(again, parameters=replace(flown.parameters, initial=initial))
    for name, flight in (("before", before), ("again", again)):
        write_ulog(tmp_path / f"{name}.ulg", flight)
    found = compare_replayed(tmp_path / "before.ulg", tmp_path / "again.ulg")
    assert {one.name for one in found.parameters} == set(overrides)
    assert found.agrees
    # docs/fidelity.md: a part in a thousand of PX4's own innovations
    assert {one.source for one in found.errors} >= {"gnss_vel", "baro_hgt", "mag"}
    assert max(one.difference for one in found.errors) < 0.002


def px4s_topics(file: Path) -> dict[tuple[str, int], TopicTable]:
    """Innovations that PX4's own estimator computed, as its log has them."""
    rows = pq.read_table(file).to_pandas()
    found: dict[tuple[str, int], TopicTable] = {}
    for source in MEASURED_SOURCES.values():
        axes = [rows[(rows["source"] == source.name) & (rows["axis"] == axis)] for axis in range(source.axes)]
        if not all(len(axis) for axis in axes):
            continue
        times = axes[0]["timestamp_sample"].to_numpy(np.int64)
        table = {"timestamp": times, "timestamp_sample": times}
        for number, axis in enumerate(axes):
            column = f"[{number}]" if source.axes > 1 else ""
            for name in ("innovation", "innovation_variance"):
                table[f"{name}{column}"] = axis[name].to_numpy(np.float32)
        table |= {name: axes[0][name].to_numpy() for name in ("innovation_rejected", "fused")}
        found[source.topic, 0] = table
    return found


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
