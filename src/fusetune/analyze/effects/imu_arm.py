"""Where the IMU sits (`EKF2_IMU_POS_*`)."""

from __future__ import annotations

from fusetune.analyze.effects.estimate import Effect
from fusetune.analyze.effects.told import refused
from fusetune.analyze.observed.observed_flight import ObservedFlight


def estimate_imu_arm(observed: ObservedFlight) -> Effect:
    """Refused: measurements tell where a sensor is from the IMU, not where the IMU is in the body.

    EKF2 takes the difference of both positions in every measurement (`ekf2/numerics/lever_arm.py`), so no innovation
    changes where the IMU and all sensors are shifted together.
    """
    told = [observed.parameters.get(f"EKF2_IMU_POS_{axis}", 0.0) for axis in "XYZ"]
    why = (
        "flights tell how far each sensor is from the IMU alone, not where both are in the body; measure it from the"
        " centre of gravity with a rule, and set the arms of the other sensors after it"
    )
    return refused("imu_lever_arm", why, told_x_m=told[0], told_y_m=told[1], told_z_m=told[2])
