"""The wheel, where its libraries are and nothing of the checkout is: from three logs to the parameter file.

The environment is a new one that finds the libraries where those of the tests lie, by a path and not by a link to the
checkout as an editable installation has it. The compiled kernels are there as after a first run, in the user's cache;
a process that opens a file of the checkout writes that down.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from numba.core import config
from tests.workflow.conftest import ONE_MORE_MESSAGE, ROOT, Workspace

from fusetune.ekf2.compiled.compilation import kernel_folder
from fusetune.ekf2.replay.warm_up import compile_kernels

SOURCES = ("src", "workflow", "config", "setup.py", "pyproject.toml", "README.md", "LICENSE", "MANIFEST.in")
LIBRARIES = sysconfig.get_path("purelib")

WATCHES = """
import os, sys
def watch(event, arguments):
    if event == "open" and isinstance(arguments[0], (str, bytes)):
        path = os.path.abspath(os.fsdecode(arguments[0]))
        if path.startswith({root!r} + os.sep) and not path.startswith({libraries!r}):
            descriptor = os.open({opened!r}, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
            os.write(descriptor, os.fsencode(path) + b"\\n")
            os.close(descriptor)
sys.addaudithook(watch)
"""
BUILDS = """
import sys
from setuptools import build_meta
made = sys.argv[1]
print(build_meta.build_sdist(made), build_meta.build_wheel(made))
"""


def built(folder: Path) -> tuple[Path, Path]:
    """Source distribution and wheel, built from a copy of the checkout: `build/` there might hold what is no more."""
    copied, made = folder / "sources", folder / "made"
    made.mkdir(parents=True)
    for name in SOURCES:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, copied / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        else:
            copied.mkdir(exist_ok=True)
            shutil.copy(source, copied)
    command = [sys.executable, "-c", BUILDS, str(made)]
    printed = subprocess.run(command, cwd=copied, check=True, capture_output=True, text=True).stdout.splitlines()
    sources, wheel = printed[-1].split()
    return made / sources, made / wheel


@pytest.fixture(scope="module")
def distributions(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return built(tmp_path_factory.mktemp("distributions"))


def test_wheel_and_source_distribution_hold_all_that_the_package_reads(distributions: tuple[Path, Path]) -> None:
    package = ROOT / "src" / "fusetune"
    unimported = (file for file in package.rglob("*") if file.is_file() and file.suffix not in {".pyc", ".nbi", ".nbc"})
    needed = {f"fusetune/{file.relative_to(package)}" for file in unimported}
    assert {"fusetune/py.typed", "fusetune/px4/parameters/ekf2_parameters.csv"} <= needed
    carried = {str(file.relative_to(ROOT)) for name in ("workflow", "config") for file in (ROOT / name).rglob("*.*")}
    carried = {name for name in {*carried, "workflow/Snakefile"} if "__pycache__" not in name}
    sources, wheel = distributions
    with zipfile.ZipFile(wheel) as file:
        names = set(file.namelist())
    assert (needed | {f"fusetune/packaged/{name}" for name in carried}) - names == set()
    assert {name.partition("/")[0] for name in names if ".dist-info/" not in name} == {
        one.name for one in (ROOT / "src").iterdir() if one.suffix != ".egg-info"
    }
    with tarfile.open(sources) as file:
        inside = {name.partition("/")[2] for name in file.getnames()}
    assert ({f"src/{name}" for name in needed} | carried | {"setup.py"}) - inside == set()


@pytest.fixture(scope="module")
def installed(distributions: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Callable[..., str]:
    """Runs a program of the environment in a folder, and returns what it printed."""
    if config.DISABLE_JIT:
        pytest.skip("Numba is switched off")
    place = tmp_path_factory.mktemp("installed")
    venv.create(place / "venv", with_pip=True)
    python = place / "venv" / "bin" / "python"
    ours = ("PYTHON", "NUMBA_", "FUSETUNE_")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    environment |= {"XDG_CACHE_HOME": str(place / "cache"), "HOME": str(place), "OPENBLAS_NUM_THREADS": "1"}
    pip = [str(python), "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-index"]
    subprocess.run([*pip, "--no-deps", "--no-compile", str(distributions[1])], env=environment, check=True)
    ask = [str(python), "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    packages = Path(subprocess.run(ask, check=True, capture_output=True, text=True).stdout.strip())
    (packages / "libraries.pth").write_text(f"{LIBRARIES}\n", encoding="utf-8")
    libraries = sysconfig.get_path("data") + os.sep
    watch = WATCHES.format(root=str(ROOT), libraries=libraries, opened=str(place / "opened"))
    (packages / "sitecustomize.py").write_text(watch, encoding="utf-8")
    compile_kernels()
    caches = Path(config.CACHE_DIR)
    kernels = Path("fusetune", "numba", caches.name, kernel_folder().relative_to(caches))
    shutil.copytree(kernel_folder(), place / "cache" / kernels)

    def run(*command: str, cwd: Path) -> str:
        done = subprocess.run([str(python), *command], cwd=cwd, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        opened = place / "opened"
        assert not opened.exists(), opened.read_text(encoding="utf-8")
        return done.stdout + done.stderr

    return run


def test_from_three_logs_in_an_empty_folder_to_the_parameter_file(
    installed: Callable[..., str], demonstration: Workspace, tmp_path: Path
) -> None:
    asked = "from fusetune.running.workflow_files import workflow_file; print(workflow_file())"
    snakefile = installed("-c", asked, cwd=tmp_path).strip()
    assert "site-packages/fusetune/packaged" in snakefile
    logs = sorted((demonstration.folder / "results" / "execute").glob("*.ulg"))
    given = []
    for number, content in enumerate(
        (logs[0].read_bytes(), logs[1].read_bytes(), logs[0].read_bytes() + ONE_MORE_MESSAGE)
    ):
        given.append(tmp_path / "card" / f"log{number}.ulg")
        given[-1].parent.mkdir(exist_ok=True)
        given[-1].write_bytes(content)
    empty = tmp_path / "empty"
    empty.mkdir()
    printed = installed("-m", "fusetune.cli", "run", *map(str, given), "--cores", "2", "--json", cwd=empty)
    told = json.loads(printed[printed.index("{") : printed.rindex("}") + 1])
    assert (told["flights"], told["refused"], told["simulated"]) == (3, 0, False)
    for file in told["files"].values():
        assert (empty / file).stat().st_size > 0
    # logs stay where they are
    assert [one.resolve() for one in sorted((empty / "flights").iterdir())] == given
    # what jobs in an environment of conda's would import
    assert (empty / ".snakemake" / "fusetune_package" / "fusetune" / "packaged").samefile(Path(snakefile).parents[1])
    # the configuration that came with it is named as in a checkout
    results = empty / "results"
    assert '"config/config.yaml"' in (results / "apply" / "decision.json").read_text(encoding="utf-8")
    again = installed("-m", "snakemake", "--snakefile", snakefile, "--dry-run", cwd=empty)
    assert "Nothing to be done" in again
