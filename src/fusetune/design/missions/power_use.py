"""What flying a path takes of the battery, by momentum theory, from how long the vehicle hovers.

The air that a rotor pushes down goes through it with the induced velocity v, found from
v = v_h² T / √(V_t² + (V_n + v)²) (Glauert), where v_h is that of hover, T the thrust over the weight, V_t and V_n the
speed along the rotor's disc and through it. The induced power over that of hover is then T (v + V_n) / v_h; the rest of
the power, which turns the blades against their drag, goes with the third power of their speed, T^1.5 (Leishman,
Principles of Helicopter Aerodynamics, 2nd edition, sections 2.2 and 2.14). Momentum theory does not hold in the rotor's
own wake: coming down is counted as hovering. The air is still.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fusetune.design.missions.endurance import GRAVITY_M_S2, NO_DRAG, Drag, Endurance

Array = npt.NDArray[np.float64]

_ITERATIONS = 60


def power_over_hover(velocity: Array, acceleration: Array, endurance: Endurance, drag: Drag = NO_DRAG) -> Array:
    """(N,) power over that of hover.

    Parameters
    ----------
    velocity, acceleration : (N, 3) north, east, down; m/s, m/s²
    """
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    resistance = (drag.linear_1_s + drag.quadratic_1_m * speed) * velocity
    force = acceleration + resistance - np.array([0.0, 0.0, GRAVITY_M_S2])
    size = np.linalg.norm(force, axis=1)
    thrust, axis = size / GRAVITY_M_S2, force / size[:, None]
    through = np.sum(velocity * axis, axis=1)
    along = np.sqrt(np.maximum(speed[:, 0] ** 2 - through**2, 0.0))
    through = np.maximum(through, 0.0)
    hover = endurance.hover_induced_m_s
    induced = np.full(len(velocity), hover) * np.sqrt(thrust)
    for _ in range(_ITERATIONS):
        # halfway: the plain iteration swings about the solution where the rotor stands in the air
        induced = 0.5 * (induced + hover**2 * thrust / np.hypot(along, through + induced))
    share = endurance.induced_share
    return np.asarray(share * thrust * (induced + through) / hover + (1.0 - share) * thrust**1.5)


def battery_share(time_s: Array, power: Array, endurance: Endurance) -> float:
    """Share of a full battery that a flight takes.

    Parameters
    ----------
    time_s : (N,) ascending
    power : (N,) over that of hover
    """
    return float(np.trapezoid(power, time_s)) / (60.0 * endurance.hover_minutes)
