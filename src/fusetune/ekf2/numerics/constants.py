"""Physical constants as PX4 v1.16 has them (`lib/geo/geo.h`, `lib/atmosphere/atmosphere.h`), and its resolution."""

import numpy as np

ONE_G = 9.80665
"""Standard gravity (m/s²), which PX4 uses everywhere."""

AIR_DENSITY_SEA_LEVEL = 1.225
"""Air density (kg/m³) at 15 °C."""

RADIUS_OF_EARTH = 6371000.0
"""Radius (m) of the sphere on which the local frame is a map projection."""

EARTH_SPIN_RATE = 7.2921150e-5
"""Rotation rate of the Earth (rad/s)."""

FLT_EPSILON = float(np.finfo(np.float32).eps)
"""Resolution of single precision at 1, by which PX4's generated equations keep divisors off zero."""

FLT_EPSILON_IN_EIGHT_DIGITS = 1.1920929e-07
"""The same as the C header prints it; antenna heading and yaw estimator are calculated with that, to the last bit."""
