"""Where compiled kernels are kept.

Numba's cache looks only at the file a kernel stands in, not at the files of what it calls: beside the sources it would
hand out stale kernels. A folder named by a digest of the sources cannot. Below it, `kernel_locator` parts what is
compiled for one processor from what is compiled for another.

Kernels are machine code: they are loaded only from where nobody may write who may not write the package itself.
"""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

from fusetune.running.workflow_files import checkout
from fusetune.running.write_access import others_may_write, others_may_write_below, take_write_access
from fusetune.storage.digest import source_digest
from fusetune.storage.files import AnyPath

LOCATOR = "fusetune.ekf2.compiled.kernel_locator.KernelLocator"
PACKAGE = Path(__file__).resolve().parents[2]
COMPILES = "fusetune.ekf2.replay.warm_up"
"""The module that, when it is run, calls the entry once and so compiles all."""
RECORD_NAME = "compiled.json"
"""Digests of the files that were compiled, in their folder."""
KERNEL_SOURCES = ("ekf2", "px4/aid_sources.py")
"""What the machine code follows from."""


def kernel_cache() -> Path:
    """Folder for the kernels of these sources: below the checkout, or in the user's cache.

    The user's cache serves where there is no checkout, where this user may not write there, and where more people may
    than may write the package. It lies where NUMBA_CACHE_DIR says, else where the system keeps caches
    (XDG_CACHE_HOME or ~/.cache, on macOS ~/Library/Caches).
    """
    below = _below()
    if os.environ.get("NUMBA_CACHE_DIR") and not kernel_folder_is_told():
        return Path(os.environ["NUMBA_CACHE_DIR"]) / "fusetune" / below
    top = checkout()
    if top is not None:
        folder = top / ".cache" / below
        existing = next(part for part in (folder, *folder.parents) if part.exists())
        if os.access(existing, os.W_OK | os.X_OK) and not others_may_write(top, PACKAGE):
            return folder
    return platformdirs.user_cache_path("fusetune", appauthor=False) / below


def kernel_folder_is_told() -> bool:
    """Whether NUMBA_CACHE_DIR comes from a process of ours, and so is the very folder; a user's is for all programs."""
    return bool(os.environ.get("NUMBA_CACHE_DIR")) and os.environ.get("NUMBA_CACHE_LOCATOR_CLASSES") == LOCATOR


def use_kernel_cache() -> Path:
    """Let this process and its children keep compiled kernels in `kernel_cache`; call it before Numba is imported.

    The folder of the process that started this one is kept to, if it told one for these sources: on a machine that may
    not write there, this process would choose another.

    Returns
    -------
    Path
        The folder; it is made when there is something to keep.
    """
    folder = kernel_cache()
    told = Path(os.environ.get("NUMBA_CACHE_DIR", ""))
    if kernel_folder_is_told() and told.name == folder.name:
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
    return caches.parents[1] if caches.parts[-2:] == _below().parts else caches


def digest_of_sources() -> str:
    """By which the folder of kernels is named."""
    return source_digest(*KERNEL_SOURCES)[:16]


def _below() -> Path:
    return Path("numba") / digest_of_sources()
