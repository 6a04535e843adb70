"""What the package may take for granted: the libraries of a plain installation, and nothing that only POSIX has."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

IMPORT_ALL = """
import importlib, pkgutil, sys
import fusetune
def import_all():
    names = [module.name for module in pkgutil.walk_packages(fusetune.__path__, "fusetune.")]
    for name in names:
        importlib.import_module(name)
    return names
"""


def said_by(code: str, root: Path) -> list[str]:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(root / "src"), str(root)])}
    return subprocess.run(
        [sys.executable, "-c", code], env=environment, check=True, capture_output=True, text=True, cwd=root
    ).stdout.split()


def test_every_module_can_be_imported_where_there_is_no_posix(project_root: Path) -> None:
    """The libraries are there before: they ask for this system's own."""
    code = IMPORT_ALL + (
        "before = import_all()\n"
        "for name in before: del sys.modules[name]\n"
        "import tests.as_on_windows\n"
        "print(len(before), len(import_all()), fusetune.file_lock.msvcrt.__name__, fusetune.file_lock.fcntl)\n"
        "print(fusetune.write_access.others_may_write(fusetune.__file__, fusetune.__path__[0]))\n"
    )
    before, after, locks, fcntl, others_may_write = said_by(code, project_root)
    assert int(before) == int(after) > 100
    assert (locks, fcntl) == ("msvcrt", "None")
    assert others_may_write == "False"
