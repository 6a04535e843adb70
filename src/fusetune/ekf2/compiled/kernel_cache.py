"""Where compiled kernels are kept.

Numba's cache looks only at the file a kernel stands in, not at the files of what it calls: beside the sources it would
hand out stale kernels. A folder named by a digest of the sources cannot. Below it, `kernel_locator` parts what is
compiled for one processor from what is compiled for another.

Kernels are machine code: they are loaded only from where nobody may write who may not write the package itself.
"""

from __future__ import annotations

import os
from pathlib import Path

from fusetune.running.write_access import others_may_write, others_may_write_below, take_write_access
from fusetune.storage.digest import source_digest
from fusetune.storage.files import AnyPath

LOCATOR = "fusetune.ekf2.compiled.kernel_locator.KernelLocator"
PACKAGE = Path(__file__).resolve().parents[2]
KERNEL_SOURCES = ("ekf2", "px4/aid_sources.py")
"""What the machine code follows from."""


def kernel_cache() -> Path:
    """Folder for the kernels of these sources: below the checkout, or in the user's cache.

    The user's cache serves where there is no checkout, where this user may not write there, and where more people may
    than may write the package.
    """
    checkout, below = PACKAGE.parents[1], Path("numba") / source_digest(*KERNEL_SOURCES)[:16]
    folder = checkout / ".cache" / below
    existing = next(part for part in (folder, *folder.parents) if part.exists())
    ours = os.access(existing, os.W_OK | os.X_OK) and not others_may_write(checkout, PACKAGE)
    if (checkout / "Snakefile").is_file() and ours:
        return folder
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fusetune" / below


def use_kernel_cache(inherit: bool = False) -> Path:
    """Let this process and its children keep compiled kernels in `kernel_cache`; call it before Numba is imported.

    Parameters
    ----------
    inherit
        Keep to the folder of the process that started this one, if it told one for these sources: on a machine that may
        not write there, this process would choose another.

    Returns
    -------
    Path
        The folder; it is made when there is something to keep.
    """
    folder = kernel_cache()
    told = Path(os.environ.get("NUMBA_CACHE_DIR", ""))
    if inherit and told.name == folder.name:
        folder = told
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    os.environ["NUMBA_CACHE_LOCATOR_CLASSES"] = LOCATOR
    return folder


def others_may_write_kernels(folder: AnyPath) -> bool:
    """Whether what is in a folder of the cache in use could have been put there by others."""
    return others_may_write_below(_top(), folder, PACKAGE)


def keep_others_out(folder: AnyPath) -> None:
    """Take from others the right to write to a folder of the cache in use, and on the way to it.

    Raises
    ------
    UserError
        Something on the way belongs to another user.
    """
    take_write_access(_top(), folder, PACKAGE)


def _top() -> Path:
    """The first folder on the way to the cache in use that is there for caches alone."""
    caches = Path(os.environ["NUMBA_CACHE_DIR"])
    return caches.parents[1] if caches == kernel_cache() else caches
