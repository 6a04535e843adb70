"""Where in the kernel cache Numba finds the kernels of one file.

Numba's own way names the folder by the path of the sources, so a checkout that is copied, moved or mounted elsewhere
would compile again. Here the place follows from the file's place in the package and from what machine code depends on:
processor, Numba, Python. Whether the kernel is that of the file, Numba tells by the file's content.
"""

from __future__ import annotations

import hashlib
import os
import sys
from functools import cache
from pathlib import Path

import llvmlite
import numba
from numba.core.caching import UserProvidedCacheLocator
from numba.core.registry import cpu_target

PACKAGE = Path(__file__).resolve().parents[2]


def processor() -> tuple[str, ...]:
    """This processor, as Numba names what it compiles for."""
    target: tuple[str, ...] = cpu_target.target_context.codegen().magic_tuple()
    return target


@cache
def target_name() -> str:
    """Name of what kernels are compiled for: this processor, by these versions of Numba, LLVM and Python."""
    made_by = (numba.__version__, llvmlite.__version__, sys.implementation.cache_tag, *processor())
    return hashlib.sha256(repr(made_by).encode()).hexdigest()[:16]


class KernelLocator(UserProvidedCacheLocator):  # type: ignore[misc]
    """The locator that NUMBA_CACHE_LOCATOR_CLASSES names."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """Folder for a file's kernels, relative to the cache; for files outside the package it is Numba's own."""
        file = Path(py_file).resolve()
        if not file.is_relative_to(PACKAGE):
            return str(super().get_suitable_cache_subpath(py_file))
        return os.path.join(target_name(), file.relative_to(PACKAGE).parent)

    def ensure_cache_path(self) -> None:
        """As Numba's, but kernels that are there may be loaded from where this process cannot write."""
        if not os.path.isdir(self.get_cache_path()):
            super().ensure_cache_path()
