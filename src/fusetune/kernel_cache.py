"""Where compiled kernels are kept.

Numba's cache looks only at the file a kernel stands in, not at the files of what it calls: beside the sources it would
hand out stale kernels. A folder named by a digest of the sources cannot.
"""

from __future__ import annotations

import os
from pathlib import Path

from fusetune.digest import source_digest


def kernel_cache() -> Path:
    """Folder for the kernels of these sources: below the checkout, or in the user's cache where there is none."""
    checkout = Path(__file__).resolve().parents[2]
    if (checkout / "Snakefile").is_file():
        caches = checkout / ".cache"
    else:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fusetune"
    return caches / "numba" / source_digest("ekf2")[:16]


def use_kernel_cache() -> Path:
    """Let this process and its children keep compiled kernels in `kernel_cache`; call it before Numba is imported.

    Returns
    -------
    Path
        The folder; Numba makes it when it stores a kernel.
    """
    folder = kernel_cache()
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    return folder
