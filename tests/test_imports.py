"""What the package may take for granted: the libraries of a plain installation, and nothing that only POSIX has."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement

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
        "print(len(before), len(import_all()))\n"
        "print(fusetune.storage.file_lock.msvcrt.__name__, fusetune.storage.file_lock.fcntl)\n"
        "print(fusetune.running.write_access.others_may_write(fusetune.__file__, fusetune.__path__[0]))\n"
    )
    before, after, locks, fcntl, others_may_write = said_by(code, project_root)
    assert int(before) == int(after) > 100
    assert (locks, fcntl) == ("msvcrt", "None")
    assert others_may_write == "False"


def imported_by(file: Path) -> Iterator[str]:
    """Outermost names of what a file imports; rules are not quite Python, so they are read line by line."""
    text = file.read_text(encoding="utf-8")
    if file.suffix != ".py":
        yield from re.findall(r"^\s*(?:from|import)\s+(\w+)", text, re.MULTILINE)
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module.partition(".")[0]


UPLOAD = ("src/fusetune/apply/upload", "benchmarks/upload_trials")
OF_AN_EXTRA = {
    "mlflow": ("src/fusetune/apply/history/mlflow_export.py", "tests/apply/history/test_keep.py"),
    "playwright": ("tests/browser/conftest.py", "tests/browser/looking.py", "tests/browser/test_viewer.py"),
}
"""Libraries that a plain installation lacks, and who does without them where they are not there."""


@pytest.mark.parametrize(
    ("folders", "extra"),
    [(["src", "workflow", "benchmarks"], []), (UPLOAD, ["upload"]), (["tests"], ["test"])],
    ids=["pipeline", "upload", "tests"],
)
def test_what_is_imported_is_declared(project_root: Path, folders: list[str], extra: list[str]) -> None:
    """Pipeline and benchmarks need no more than a plain installation, uploads and tests no more than their extras."""
    project = tomllib.loads((project_root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = project["dependencies"] + [text for name in extra for text in project["optional-dependencies"][name]]
    declared = {Requirement(text).name.lower() for text in asked}
    suffixes = {".py", ".smk"}
    files = [file for folder in folders for file in (project_root / folder).rglob("*") if file.suffix in suffixes]
    if folders is not UPLOAD:
        files = [file for file in files if not file.relative_to(project_root).as_posix().startswith(UPLOAD)]
    ours = {"fusetune", "snakemake_logger_plugin_fusetune", "benchmarks", "tests", *sys.stdlib_module_names}
    files.append(project_root / "workflow" / "Snakefile")
    found = {
        name: file
        for file in files
        for name in imported_by(file)
        if name not in ours and file.relative_to(project_root).as_posix() not in OF_AN_EXTRA.get(name, ())
    }
    assert ("pymavlink" if folders is UPLOAD else "numpy") in found
    of = packages_distributions()
    missing = {name: file for name, file in found.items() if not declared & {d.lower() for d in of.get(name, [name])}}
    assert missing == {}
