"""What the airspeed aid source keeps between its kernels."""

import numpy as np

from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE

AIRSPEED_MEMORY = np.dtype([("H", "f8", (ERROR_STATE_SIZE,))], align=True)
"""Sub-record `ekf.airspeed`: Jacobian of the sample in hand."""
