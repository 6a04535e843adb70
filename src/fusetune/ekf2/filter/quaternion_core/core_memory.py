"""What the filter of v1.13 and v1.14 remembers beside the state."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE
from fusetune.ekf2.releases.by_release import by_release

Q3 = ERROR_STATE_SIZE - 1
"""Place of the quaternion's last element in the error state; the others have the first three."""

INITIAL_INTERVAL_S = 0.01

QUATERNION_CORE = np.dtype(
    [
        *fields("f8", "mean_dt", "innovation_variance"),
        *fields("f8", "kept_gyro_bias_var", "kept_accel_bias_var", "mean_force", shape=(3,)),
        ("time_accel_bias_passed", "i8"),
        ("gains", "f8", (3, ERROR_STATE_SIZE)),
    ],
    align=True,
)
"""Sub-record `ekf.quaternion`.

`mean_dt` (s) is the mean interval by which biases are scaled now; `innovation_variance` that by which the present gain
was divided; `kept_…_bias_var` what the variances of a bias were when its learning was stopped; `mean_force` the
low-passed specific force (m/s², body); `time_accel_bias_passed` when the accelerometer's bias was last beyond doubt
(µs); `gains` those of axes that are fused one after the other but computed at once.
"""


@kernel
def _remember_nothing(ekf):
    """v1.16 has no such memory."""


@kernel
def _set_interval(ekf):
    ekf.quaternion.mean_dt = INITIAL_INTERVAL_S


initialise_quaternion_core = by_release(_remember_nothing, "adds_quaternion_errors", _set_interval)


@kernel
def quaternion_place(element):
    """Where an element (0 … 3) of the quaternion stands in the error state."""
    return element if element < 3 else Q3
