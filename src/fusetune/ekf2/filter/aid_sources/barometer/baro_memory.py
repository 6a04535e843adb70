"""What the barometer aid source remembers between updates."""

import numpy as np

BARO_MEMORY = np.dtype([("lpf", "f8"), ("counter", "i8")], align=True)
"""Sub-record `ekf.baro`: filtered height (m, up) and the number of samples filtered since the last reset."""
