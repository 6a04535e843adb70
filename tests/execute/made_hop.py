"""A short flight of the simulated vehicle as a log, for tests that need one from end to end."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tests.shared_folder import ROOT

from fusetune.design.missions.mission import load_mission
from fusetune.execute import simulate
from fusetune.execute.vehicle import load_vehicle

_HOP = """\
name: hop
description: Two legs and back.
home: {lat: 47.397742, lon: 8.545594, alt: 488.0, geoid_undulation_m: 47.4, heading_deg: 20}
speed_m_s: 6
takeoff: {altitude_m: 6, climb_speed_m_s: 3.0, ground_s: 12}
waypoints:
  - {lat: 47.398000, lon: 8.545600, alt: 8, turn: fly_over}
  - {lat: 47.398000, lon: 8.545900, alt: 8, turn: fly_by}
landing: {mode: return, descent_speed_m_s: 2.0, ground_s: 3}
"""


def fly_hop(log: Path, overrides: Mapping[str, float], seed: int) -> Path:
    """Fly for a minute with some parameters, and write the log; returns it."""
    mission = log.with_suffix(".yaml")
    mission.write_text(_HOP, encoding="utf-8")
    simulate(load_mission(mission), load_vehicle(ROOT / "config/vehicles/quadrotor.yaml"), overrides, seed, (), log)
    return log
