"""How long a vehicle flies, as its file says it. Nothing heavier than the standard library: files are read with it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fusetune.settings.declaration import required, setting

GRAVITY_M_S2 = 9.80665
AIR_KG_M3 = 1.225
"""At sea level in the standard atmosphere."""


@dataclass(frozen=True)
class Endurance:
    """How long a vehicle flies."""

    hover_minutes: float = required("time that a full battery hovers", unit="minutes", above=0, high=600)
    mass_kg: float = required("mass at take-off", unit="kg", above=0, high=500)
    rotors: int = required("number of rotors", low=1, high=32)
    rotor_diameter_m: float = required("diameter of a rotor", unit="m", above=0, high=5)
    induced_share: float = setting(
        0.65,
        "share of the power at hover that the air takes (figure of merit); small rotors 0.5 to 0.7",
        low=0.2,
        high=1,
    )
    reserve: float = setting(0.3, "share of the battery that is left at landing", low=0, high=0.9)

    @property
    def hover_induced_m_s(self) -> float:
        """Induced velocity at hover, √(m g / 2 ρ A)."""
        area = self.rotors * math.pi * (0.5 * self.rotor_diameter_m) ** 2
        return math.sqrt(self.mass_kg * GRAVITY_M_S2 / (2.0 * AIR_KG_M3 * area))


@dataclass(frozen=True)
class Drag:
    """Drag per mass: one part with the speed, one with its square."""

    linear_1_s: float = 0.0
    quadratic_1_m: float = 0.0


NO_DRAG = Drag()
