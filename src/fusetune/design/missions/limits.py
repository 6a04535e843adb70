"""How fast and how hard a vehicle flies a mission."""

from __future__ import annotations

from dataclasses import dataclass

from fusetune.settings.declaration import required


@dataclass(frozen=True)
class Limits:
    """Limits of the planned path."""

    horizontal_speed_m_s: float = required("horizontal speed", unit="m/s", above=0, high=30)
    climb_speed_m_s: float = required("speed upwards", unit="m/s", above=0, high=15)
    descent_speed_m_s: float = required("speed downwards", unit="m/s", above=0, high=10)
    acceleration_m_s2: float = required("acceleration", unit="m/s²", above=0.2, high=8)
    jerk_m_s3: float = required("change of the acceleration", unit="m/s³", above=0.2, high=100)
    yaw_rate_deg_s: float = required("rate of turn", unit="degrees/s", above=1, high=360)
    yaw_acceleration_deg_s2: float = required("change of the rate of turn", unit="degrees/s²", above=5, high=1000)


PX4_LIMITS = Limits(
    horizontal_speed_m_s=12.0,
    climb_speed_m_s=3.0,
    descent_speed_m_s=1.5,
    acceleration_m_s2=3.0,
    jerk_m_s3=4.0,
    yaw_rate_deg_s=45.0,
    yaw_acceleration_deg_s2=60.0,
)
"""A multicopter that nobody tuned: PX4's defaults of MPC_XY_VEL_MAX, MPC_Z_V_AUTO_UP, MPC_Z_V_AUTO_DN, MPC_ACC_HOR,
MPC_JERK_AUTO, MPC_YAWRAUTO_MAX and MPC_YAWRAUTO_ACC in v1.16."""
