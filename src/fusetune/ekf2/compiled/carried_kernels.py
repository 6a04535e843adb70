"""Kernels that a wheel carries, compiled for a level of processors and taken over by one that has what that asks for.

Machine code for x86-64-v3 uses only instructions that each processor of the level has, so it runs on all of them and,
as nothing is contracted or reordered, computes the same bits as what is compiled for the one at hand. It is found by
what it follows from: sources, Numba, LLVM, Python, system, level. It is taken into the cache if this processor has all
features of the level, if not a byte of it has changed, and if nobody could have written it who may not write the
package. `fusetune.ekf2.compiled.compilation` then lets a process of its own load and run it first.

    python -m fusetune.ekf2.compiled.carried_kernels FOLDER     # makes what a wheel carries
"""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import llvmlite
import llvmlite.binding as llvm
import numba
from numba.core import config
from numba.core.serialize import dumps

from fusetune.ekf2.compiled.kernel_cache import COMPILES, LOCATOR, PACKAGE, RECORD_NAME, digest_of_sources
from fusetune.running.write_access import others_may_write_below
from fusetune.storage.files import AnyPath, atomic_path

LEVEL = "x86-64-v3"
FEATURES = (
    "cmov", "cx8", "fxsr", "mmx", "sse", "sse2", "64bit",
    "cx16", "popcnt", "sahf", "sse3", "sse4.1", "sse4.2", "ssse3",
    "avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave",
)  # fmt: skip
"""What the level asks for, by LLVM's names (System V ABI for AMD64, supplement on micro-architecture levels)."""

CARRIED = PACKAGE / "packaged" / "kernels"


def carried_folder(carried: AnyPath = CARRIED) -> Path:
    """Where kernels for these sources and libraries would lie."""
    triple = llvm.get_process_triple()
    made_by = (numba.__version__, llvmlite.__version__, sys.implementation.cache_tag, triple, LEVEL)
    return Path(carried) / digest_of_sources() / hashlib.sha256(repr(made_by).encode()).hexdigest()[:16]


def has_level() -> bool:
    """Whether this processor, and its system, have all that the level asks for."""
    features = llvm.get_host_cpu_features()
    return all(features.get(name, False) for name in FEATURES)


def may_be_taken(folder: AnyPath) -> bool:
    """Whether kernels in a folder of the package are for this processor, and nobody else can have written them.

    Where Numba is told what to compile for, other processors may share the cache, which have less than this one.
    """
    told = any(getattr(config, name) is not None for name in ("CPU_NAME", "CPU_FEATURES"))
    return Path(folder).is_dir() and not told and has_level() and not others_may_write_below(PACKAGE, folder, PACKAGE)


def take_over(carried: AnyPath, folder: AnyPath, processor: tuple[str, ...]) -> None:
    """Copy kernels, for Numba to find them as those of a processor.

    Parameters
    ----------
    carried
        A folder of kernels.
    folder
        It exists, and is that of the processor in the cache.
    processor
        As Numba names what it compiles for.
    """
    for file in sorted(Path(carried).iterdir()):
        target = Path(folder, file.name)
        if file.suffix == ".nbi":
            _write_index(file, target, processor)
        elif file.suffix == ".nbc":
            with atomic_path(target) as temporary:
                shutil.copyfile(file, temporary)


def _write_index(file: Path, target: Path, processor: tuple[str, ...]) -> None:
    """Numba's index has the version of Numba and, by signature, processor and byte code, the names of the files."""
    with open(file, "rb") as opened:
        version = pickle.load(opened)
        stamp, overloads = pickle.loads(opened.read())
    renamed = {(signature, processor, code): name for (signature, _, code), name in overloads.items()}
    with atomic_path(target) as temporary, open(temporary, "wb") as opened:
        pickle.dump(version, opened, protocol=-1)
        opened.write(dumps((stamp, renamed)))


def make_carried(carried: AnyPath) -> Path:
    """Compile the estimator for the level and put it where a wheel carries it; this processor must have the level.

    Raises
    ------
    RuntimeError
        It has not, or Numba does not compile the estimator in one piece.
    """
    if not has_level():
        raise RuntimeError(f"this processor lacks what {LEVEL} asks for, so it cannot make kernels for that")
    with tempfile.TemporaryDirectory() as caches:
        settings = {"NUMBA_CPU_NAME": LEVEL, "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": caches}
        settings |= {"NUMBA_CACHE_LOCATOR_CLASSES": LOCATOR}
        subprocess.run([sys.executable, "-m", COMPILES], env=os.environ | settings, umask=0o022, check=False)
        found = [record.parent for record in Path(caches).rglob(RECORD_NAME)]
        if len(found) != 1:
            raise RuntimeError("the estimator was not compiled")
        folder = carried_folder(carried)
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(found[0], folder)
    return folder


if __name__ == "__main__":
    print(make_carried(sys.argv[1]))
