"""Power in flight against the formulas of momentum theory, solved by hand where they can be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fusetune.design.missions.endurance import Drag, Endurance
from fusetune.design.missions.power_use import battery_share, power_over_hover

IDEAL = Endurance(hover_minutes=10.0, mass_kg=2.0, rotors=4, rotor_diameter_m=0.3, induced_share=1.0)
# √(m g / (2 ρ A)), A = 4 π 0.15²
HOVER_M_S = math.sqrt(2.0 * 9.80665 / (2.0 * 1.225 * 4.0 * math.pi * 0.15**2))


def power(velocity: tuple[float, float, float], endurance: Endurance = IDEAL, drag: Drag | None = None) -> float:
    return float(power_over_hover(np.array([velocity]), np.zeros((1, 3)), endurance, drag or Drag())[0])


def test_hovering_takes_what_hovering_takes() -> None:
    assert IDEAL.hover_induced_m_s == pytest.approx(HOVER_M_S)
    assert power((0.0, 0.0, 0.0)) == pytest.approx(1.0)
    # half of ten minutes
    assert battery_share(np.array([0.0, 300.0]), np.ones(2), IDEAL) == pytest.approx(0.5)


@pytest.mark.parametrize("climb_m_s", [1.0, 3.0, 8.0])
def test_climbing_vertically(climb_m_s: float) -> None:
    # v = −V/2 + √((V/2)² + v_h²); power (V + v) / v_h
    induced = -0.5 * climb_m_s + math.hypot(0.5 * climb_m_s, HOVER_M_S)
    assert power((0.0, 0.0, -climb_m_s)) == pytest.approx((climb_m_s + induced) / HOVER_M_S, rel=1e-6)


@pytest.mark.parametrize("speed_m_s", [2.0, 6.0, 15.0])
def test_flying_level_without_drag(speed_m_s: float) -> None:
    # v⁴ + V² v² − v_h⁴ = 0
    induced = math.sqrt(-0.5 * speed_m_s**2 + math.hypot(0.5 * speed_m_s**2, HOVER_M_S**2))
    assert power((speed_m_s, 0.0, 0.0)) == pytest.approx(induced / HOVER_M_S, rel=1e-6)
    # the blades' own drag stays
    real = Endurance(10.0, 2.0, 4, 0.3, induced_share=0.6)
    assert power((speed_m_s, 0.0, 0.0), real) == pytest.approx(0.6 * induced / HOVER_M_S + 0.4, rel=1e-6)


def test_drag_and_acceleration_ask_for_thrust_and_coming_down_saves_nothing() -> None:
    accelerated = power_over_hover(np.zeros((1, 3)), np.array([[0.0, 0.0, -9.80665]]), IDEAL)
    # twice the thrust at rest: 2^1.5
    assert accelerated[0] == pytest.approx(2.0**1.5)
    assert power((10.0, 0.0, 0.0), drag=Drag(0.3, 0.02)) > power((10.0, 0.0, 0.0)) * 1.5
    assert power((0.0, 0.0, 1.5)) == pytest.approx(1.0)
