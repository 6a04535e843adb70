"""What the drag aid source remembers between updates, and the means that it observes."""

import numpy as np

from fusetune.ekf2.feed.sensor_samples import DRAG_SAMPLE
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE
from fusetune.ekf2.releases.by_release import marked

DRAG_MEMORY = np.dtype([("H", "f8", (2, ERROR_STATE_SIZE))], align=True)
"""Sub-record `ekf.drag`: work space."""

DRAG_ACCUMULATOR = np.dtype(
    [
        ("sample_count", "i8"),
        ("delta_vel_sum", "f8", (2,)),
        ("time_sum_us", "i8"),
        ("dt_sum", "f8"),
        ("produced", DRAG_SAMPLE),
    ],
    align=True,
)
"""Sums of the IMU samples since the last mean, and that mean. Zero at start."""


def drag_accumulator(release: str) -> np.dtype:
    """DRAG_ACCUMULATOR of a release."""
    return marked(DRAG_ACCUMULATOR, release)
