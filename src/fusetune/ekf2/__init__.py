"""Our own implementation of PX4's EKF2, behaviour of release v1.16, compiled with Numba.

Importing it decides where compiled kernels are kept (see `compiled/kernel_cache.py`), unless NUMBA_CACHE_DIR says so.
"""

import os
import sys

from fusetune.ekf2.compiled.kernel_cache import LOCATOR, use_kernel_cache

if "NUMBA_CACHE_DIR" not in os.environ:
    use_kernel_cache()
os.environ["NUMBA_CACHE_LOCATOR_CLASSES"] = LOCATOR
if "numba" in sys.modules:
    from numba.core import config

    config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"]  # type: ignore[attr-defined]
    config.CACHE_LOCATOR_CLASSES = LOCATOR  # type: ignore[attr-defined]
