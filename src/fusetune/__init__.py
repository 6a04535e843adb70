"""Choose PX4 EKF2 parameters from flight logs, without ground truth."""

import os

__version__ = "0.1.0"

# Arrow's own allocators hold on to what was freed, of a small log several times its size. It reads this once, when it
# is loaded.
os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
