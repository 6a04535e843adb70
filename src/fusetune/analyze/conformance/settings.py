"""When a waypoint counts as passed, and a moment as one manoeuvre or another; argued in docs/conformance.md."""

from __future__ import annotations

from dataclasses import dataclass

from fusetune.settings.declaration import setting


@dataclass(frozen=True)
class ConformanceSettings:
    """When a waypoint counts as passed, and a moment as one manoeuvre or another.

    Pairs are where a manoeuvre begins and where it ends: between them it goes on.
    """

    crossing_m: float = setting(
        2.0,
        "a waypoint that is crossed, or held at, is passed within this, or what the vehicle does not know if more",
        unit="m",
        above=0,
        high=100,
    )
    """NAV_ACC_RAD of PX4's multicopters: nearer it does not ask to come."""
    height_m: float = setting(
        0.8,
        "a waypoint is passed within this height, or what the vehicle does not know of it if more",
        unit="m",
        above=0,
        high=100,
    )
    """PX4's NAV_MC_ALT_RAD."""
    unknown_sigmas: float = setting(
        3.0,
        "so many standard deviations of its own position a vehicle may be off without it being told",
        low=0,
        high=10,
    )
    least_unknown_m: float = setting(
        0.5, "least standard deviation of its own position and height that is assumed", unit="m", low=0, high=10
    )
    """Filters claim less: the barometer alone drifts by as much in minutes."""
    hover_m_s: tuple[float, float] = setting(
        (0.5, 0.8), "hover begins below this horizontal speed, and ends above", unit="m/s", above=0, high=10
    )
    """`HOVER_M_S` of the excitation; PX4's MPC_HOLD_MAX_XY, from where on it brakes before it holds."""
    climb_m_s: tuple[float, float] = setting(
        (0.6, 0.3), "climb or descent begins above this vertical speed, and ends below", unit="m/s", above=0, high=10
    )
    """PX4's MPC_HOLD_MAX_Z, the vertical speed of a vehicle that holds; `CLIMB_M_S` of the excitation."""
    climb_angle_deg: tuple[float, float] = setting(
        (30.0, 20.0), "and only where the path is steeper than this", unit="degrees", above=0, high=90
    )
    """On a flatter path the vehicle travels, and changes its height on the way."""
    turn_deg_s: tuple[float, float] = setting(
        (12.0, 6.0), "turn begins where course or heading turn faster than this, and ends below", unit="degrees/s",
        above=0, high=360,
    )  # fmt: skip
    """Gusts turn the course of a quadrotor at 5 m/s by up to some 5 °/s."""
    turn_least_deg: float = setting(
        15.0, "a turn changes the course by at least this; what changes it less is straight", unit="degrees", above=0,
        high=180,
    )  # fmt: skip
    shortest_s: float = setting(1.0, "a manoeuvre lasts so long at least", unit="s", above=0, high=30)


DEFAULTS = ConformanceSettings()
