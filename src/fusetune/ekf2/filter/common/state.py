"""Where each quantity sits in the error state, and in the state vector that PX4 publishes.

The error state has 24 elements: the attitude error is a rotation vector in the NED tangent frame, every other
element is the plain difference. The published vector (`estimator_states.states`) has 25, since it holds the
quaternion instead of the attitude error. Index constants are plain integers so that Numba folds them.
"""

ATTITUDE = 0
VELOCITY = 3
POSITION = 6
GYRO_BIAS = 9
ACCEL_BIAS = 12
MAG_EARTH = 15
MAG_BODY = 18
WIND = 21
TERRAIN = 23
ERROR_STATE_SIZE = 24

PUBLISHED_QUATERNION = 0
PUBLISHED_VELOCITY = 4
PUBLISHED_POSITION = 7
PUBLISHED_GYRO_BIAS = 10
PUBLISHED_ACCEL_BIAS = 13
PUBLISHED_MAG_EARTH = 16
PUBLISHED_MAG_BODY = 19
PUBLISHED_WIND = 22
PUBLISHED_TERRAIN = 24
PUBLISHED_STATE_SIZE = 25

ERROR_STATE_BLOCKS = {
    "attitude": (ATTITUDE, 3),
    "velocity": (VELOCITY, 3),
    "position": (POSITION, 3),
    "gyro_bias": (GYRO_BIAS, 3),
    "accel_bias": (ACCEL_BIAS, 3),
    "mag_earth": (MAG_EARTH, 3),
    "mag_body": (MAG_BODY, 3),
    "wind": (WIND, 2),
    "terrain": (TERRAIN, 1),
}
