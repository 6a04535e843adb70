"""Where each quantity sits in the error state, and in the state vector that PX4 publishes: one table each.

The error state has 24 elements: the attitude error is a rotation vector in the NED tangent frame, every other
element is the plain difference. The published vector (`estimator_states.states`) has 25, since it holds the
quaternion instead of the attitude error. The index constants are plain integers so that Numba folds them.

Mirrors `State::….idx` and `State::….dof` of PX4 v1.16 (`EKF/python/ekf_derivation/generated/state.h`).
"""

from collections.abc import Mapping
from itertools import accumulate


def _placed(sizes: Mapping[str, int]) -> dict[str, tuple[int, int]]:
    """First element and number of elements of parts that follow each other."""
    firsts = accumulate(sizes.values(), initial=0)
    return {name: (first, size) for first, (name, size) in zip(firsts, sizes.items(), strict=False)}


_AFTER_ATTITUDE = {
    "velocity": 3, "position": 3, "gyro_bias": 3, "accel_bias": 3, "mag_earth": 3, "mag_body": 3, "wind": 2,
    "terrain": 1,
}  # fmt: skip

ERROR_STATE_BLOCKS = _placed({"attitude": 3} | _AFTER_ATTITUDE)
"""Of each part of the error state its first element and their number."""

PUBLISHED_STATE_BLOCKS = _placed({"quaternion": 4} | _AFTER_ATTITUDE)
"""Of each part of the published state its first element and their number."""

(ATTITUDE, VELOCITY, POSITION, GYRO_BIAS, ACCEL_BIAS, MAG_EARTH, MAG_BODY, WIND, TERRAIN) = (
    first for first, _ in ERROR_STATE_BLOCKS.values()
)
ERROR_STATE_SIZE = sum(size for _, size in ERROR_STATE_BLOCKS.values())

(
    PUBLISHED_QUATERNION, PUBLISHED_VELOCITY, PUBLISHED_POSITION, PUBLISHED_GYRO_BIAS, PUBLISHED_ACCEL_BIAS,
    PUBLISHED_MAG_EARTH, PUBLISHED_MAG_BODY, PUBLISHED_WIND, PUBLISHED_TERRAIN,
) = (first for first, _ in PUBLISHED_STATE_BLOCKS.values())  # fmt: skip
PUBLISHED_STATE_SIZE = sum(size for _, size in PUBLISHED_STATE_BLOCKS.values())
