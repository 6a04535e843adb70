"""A mistake in a configuration file ends the run with one message: the file, the key and what was expected."""

from __future__ import annotations

from typing import Any

import pytest
from tests.workflow.conftest import CONFIG, MISSION, STUDY, Workspace


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
        ("config.yaml", CONFIG | {"sets_per_jop": 4}, ("config.yaml", "sets_per_jop", "sets_per_job")),
        ("config.yaml", CONFIG | {"sets_per_job": 0}, ("config.yaml", "sets_per_job", "1")),
        ("config.yaml", CONFIG | {"decision": {"draws": "many"}}, ("config.yaml", "decision.draws", "whole number")),
        ("config.yaml", CONFIG | {"flights_dir": "nowhere"}, ("config.yaml", "flights_dir", "nowhere")),
        ("config.yaml", CONFIG | {"study": "config/none.yaml"}, ("config/none.yaml", "cannot be read", "path")),
        (
            "config.yaml",
            CONFIG | {"demonstration": {"vehicle": "config/quadrotor.yaml", "faults": {"flight_9": []}}},
            ("config.yaml", "demonstration.faults", "flight_1_low"),
        ),
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


def test_an_unknown_present_flight_is_named(demonstration: Workspace) -> None:
    result = demonstration.run("--dry-run", "--config", "present_flight=flight_7")
    assert result.returncode != 0
    assert "config.yaml: present_flight is 'flight_7', which is no flight" in result.stdout
