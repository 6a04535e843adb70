"""Digest of the package's sources: the name of a kernel cache and the reason to run a job again.

Numba's cache looks only at the file a kernel stands in, not at the files of the functions it calls; Snakemake does not
look at the sources of a library at all. One digest over the files that a step uses closes both holes. Importing this
module is cheap (standard library only), because the workflow computes digests whenever it is parsed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

PACKAGE_ROOT = Path(__file__).resolve().parent
SOURCE_SUFFIXES = frozenset({".py", ".csv", ".npz", ".yaml", ".json"})


def source_files(parts: Iterable[str]) -> list[Path]:
    """List the source files of some parts of the package, in a fixed order.

    Parameters
    ----------
    parts
        Names below the package root: a sub-package (``"ekf2"``) or a module (``"digest.py"``).

    Raises
    ------
    FileNotFoundError
        A part does not exist: a digest of nothing would hide changes.
    """
    files: set[Path] = set()
    for part in parts:
        path = PACKAGE_ROOT / part
        if path.is_dir():
            files.update(file for file in path.rglob("*") if file.suffix in SOURCE_SUFFIXES)
        elif path.is_file():
            files.add(path)
        else:
            raise FileNotFoundError(f"the package has no part {part!r} at {path}")
    return sorted(files)


def source_digest(*parts: str) -> str:
    """Digest the sources of some parts of the package.

    Parameters
    ----------
    parts
        Names below the package root, as in `source_files`; none means the whole package.

    Returns
    -------
    str
        16 hexadecimal digits of SHA-256 over the relative names and the contents.
    """
    digest = hashlib.sha256()
    for file in source_files(parts or (".",)):
        digest.update(file.relative_to(PACKAGE_ROOT).as_posix().encode())
        digest.update(b"\0")
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:16]
