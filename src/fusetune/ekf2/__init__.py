"""Our own implementation of PX4's EKF2, behaviour of release v1.16, compiled with Numba.

Importing it decides where compiled kernels are kept (see `compiled/kernel_cache.py`), unless who
started this process did.
"""

import os
import sys

from fusetune.ekf2.compiled.kernel_cache import LOCATOR, kernel_folder_is_told, use_kernel_cache

if not kernel_folder_is_told():
    use_kernel_cache()
if "numba" in sys.modules:
    from numba.core import config

    config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"]  # type: ignore[attr-defined]
    config.CACHE_LOCATOR_CLASSES = LOCATOR  # type: ignore[attr-defined]
