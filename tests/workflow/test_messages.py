"""A mistake in a configuration file ends the run with one message: the file, the key and what was expected."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from tests.workflow.conftest import CONFIG, MISSION, STUDY, Workspace

from fusetune.design.study import load_study
from fusetune.errors import UserError


def sets_of(*parameters: dict[str, Any]) -> dict[str, Any]:
    return {"sets": [{"name": f"set{number}", "parameters": entry} for number, entry in enumerate(parameters)]}


@pytest.mark.parametrize(
    ("file", "document", "expected"),
    [
        ("small.yaml", STUDY | sets_of({"EKF2_ACC_NOIS": 0.3}), ("small.yaml", "EKF2_ACC_NOIS", "EKF2_ACC_NOISE")),
        ("small.yaml", STUDY | sets_of({"EKF2_ACC_NOISE": 99.0}), ("small.yaml", "EKF2_ACC_NOISE", "99")),
        ("small.yaml", STUDY | sets_of({"EKF2_GPS_CTRL": 1.5}), ("small.yaml", "EKF2_GPS_CTRL", "1.5")),
        ("small.yaml", STUDY | {"sets": [STUDY["sets"][0]] * 2}, ("small.yaml", "duplicate", "low")),
        ("hop.yaml", MISSION | {"waypoints": [{"lat": 47.4, "lon": 8.5}]}, ("hop.yaml", "waypoints[0]", "alt")),
        ("hop.yaml", MISSION | {"speed": 5}, ("hop.yaml", "speed", "speed_m_s")),
        ("config.yaml", CONFIG | {"search_jop": "flight"}, ("config.yaml", "search_jop", "search_job")),
        ("config.yaml", CONFIG | {"seed": -1}, ("config.yaml", "seed", "0")),
        ("config.yaml", CONFIG | {"sets_per_job": 8}, ("config.yaml", "sets_per_job", "no longer", "delete it")),
        ("config.yaml", CONFIG | {"decision": {"draws": "many"}}, ("config.yaml", "decision.draws", "whole number")),
        ("config.yaml", CONFIG | {"flights_dir": "nowhere"}, ("config.yaml", "flights_dir", "nowhere")),
        ("config.yaml", CONFIG | {"study": "config/none.yaml"}, ("config/none.yaml", "cannot be read", "path")),
        (
            "config.yaml",
            CONFIG | {"demonstration": {"vehicle": "config/quadrotor.yaml", "faults": {"flight_9": []}}},
            ("config.yaml", "demonstration.faults", "flight_1_low"),
        ),
        (
            "config.yaml",
            CONFIG
            | {"demonstration": {"vehicle": "config/quadrotor.yaml", "faults": {"flight_1_low": [{"kind": "x"}]}}},
            ("config.yaml", "demonstration.faults.flight_1_low", "gnss_outage"),
        ),
        ("config.yaml", CONFIG | {"scoring": {"settle_s": math.nan}}, ("config.yaml", "scoring.settle_s", "finite")),
        ("config.yaml", CONFIG | {"__use_yte__": True}, ("config.yaml", "unknown key '__use_yte__'")),
        ("quadrotor.yaml", {"name": "x"}, ("quadrotor.yaml", "limits", "missing")),
    ],
)
def test_broken_configuration(
    workspace: Workspace, file: str, document: dict[str, Any], expected: tuple[str, ...]
) -> None:
    workspace.write(file, document)
    result = workspace.run("--dry-run")
    assert result.returncode != 0
    assert "Traceback" not in result.stdout
    message = next(line for line in result.stdout.splitlines() if expected[0] in line and ": " in line)
    for part in expected:
        assert part in message, result.stdout


def test_a_key_of_the_configuration_that_stands_twice(workspace: Workspace) -> None:
    """Snakemake itself takes the last of the two."""
    with open(workspace.folder / "config" / "config.yaml", "a", encoding="utf-8") as file:
        file.write("seed: 1\nseed: 2\n")
    result = workspace.run("--dry-run")
    assert result.returncode != 0
    assert "config/config.yaml: line" in result.stdout
    assert "'seed' stands twice" in result.stdout


@pytest.mark.parametrize(
    ("setting", "part"),
    [("seed=nan", "seed is nan"), ("sets_per_jop=4", "'sets_per_jop'"), ("sets_per_job=48", "sets_per_job: no longer")],
)
def test_a_broken_value_on_the_command_line(workspace: Workspace, setting: str, part: str) -> None:
    result = workspace.run("--dry-run", "--config", setting)
    assert result.returncode != 0
    assert "--config: " in result.stdout
    assert part in result.stdout


def test_no_set_can_be_named_so_that_its_files_replace_others(demonstration: Workspace, tmp_path: Path) -> None:
    """Of every file that the rooms write beside those of sets, each part up to a dot is tried as the name of a set."""
    results = demonstration.folder / "results"
    names = ("present", "as_flown", "low", "high")
    folders = [results / "design", *(one for one in (results / "analyze").iterdir() if one.is_dir())]
    # those of the mission are called by its name
    files = {file.name for folder in folders for file in folder.iterdir() if file.stem != "hop"}
    of_sets = {file for file in files if file.split(".")[0] in names}
    endings = {file.partition(".")[2] for file in of_sets}
    clashing = {own.removesuffix(f".{end}") for own in files - of_sets for end in endings if own.endswith(f".{end}")}
    assert {"scoring", "fidelity", "onboard"} <= clashing
    for name in sorted(clashing, key=len):
        for spelled in (name, name.upper()):
            sets = [{"name": spelled, "parameters": {"EKF2_ACC_NOISE": 0.3}}]
            (tmp_path / "study.yaml").write_text(yaml.safe_dump(STUDY | {"sets": sets}), encoding="utf-8")
            with pytest.raises(UserError, match=spelled):
                load_study(tmp_path / "study.yaml")


def test_an_unknown_present_flight_is_named(demonstration: Workspace) -> None:
    result = demonstration.run("--dry-run", "--config", "present_flight=flight_7")
    assert result.returncode != 0
    assert "config.yaml: present_flight is 'flight_7', which is no flight" in result.stdout
