"""What all tests share: the kernel cache, the logs and reference figures beside the project, and `--update`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from tests.made_text import UpToDate, compare
from tests.shared_folder import ROOT, SHARED

from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache

if TYPE_CHECKING:
    from fusetune.px4.flight import Flight

# Both are read on import, so they are set before any test module is imported. The matrices are small: on several
# threads their algebra takes ten times as long.
use_kernel_cache()
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

SHARING_FOLDERS = ("tests/workflow", "tests/ekf2", "tests/report", "tests/browser")
"""Folders whose files share what takes long to make: a run of the pipeline, compiled functions, a report."""


def _shared_folder(name: str, what: str) -> Any:
    """A fixture: a folder beside the project; the test is skipped where it does not exist."""

    def shared() -> Path:
        folder = SHARED / name
        if not folder.is_dir():
            pytest.skip(f"needs {name} of real flights in {folder} (or below FUSETUNE_SHARED), which is not there")
        return folder

    shared.__doc__ = f"Folder of {what}; the test is skipped where it does not exist."
    return pytest.fixture(scope="session", name=f"shared_{name}")(shared)


def _shared_scope(nodeid: str) -> str:
    """Folder or file whose tests share fixtures."""
    file = nodeid.partition("::")[0]
    return next((folder for folder in SHARING_FOLDERS if file.startswith(f"{folder}/")), file)


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--update`: what is made from the code and kept in the repository is written anew where it is out of date."""
    parser.addoption("--update", action="store_true", help="renew tables and pictures that are made from the code")


def pytest_configure(config: pytest.Config) -> None:
    """Two processes that renew parts of one file would lose one of them."""
    if config.getoption("--update") and getattr(config.option, "numprocesses", None):
        raise pytest.UsageError("--update works in one process: leave out -n")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the folders that take longest."""
    order = {folder: number for number, folder in enumerate(SHARING_FOLDERS)}
    items.sort(key=lambda item: order.get(_shared_scope(item.nodeid), len(order)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Where tests are spread over several processes (pytest-xdist), keep those together that share fixtures."""
    from xdist.scheduler import LoadScopeScheduling

    class BySharedFixtures(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return _shared_scope(nodeid)

    return BySharedFixtures(config, log)


@pytest.fixture(scope="session")
def project_root() -> Path:
    """Top folder of the project."""
    return ROOT


@pytest.fixture
def up_to_date(request: pytest.FixtureRequest) -> UpToDate:
    """Compare made text in the repository with what the code says; with `--update`, renew it (`tests/made_text.py`)."""
    command, update = f"pytest {request.node.nodeid} --update", request.config.getoption("--update")
    return lambda file, block, text: compare(file, block, text, command, update)


@pytest.fixture(scope="session")
def survey_flight(project_root: Path) -> Flight:
    """The survey mission as a simulated vehicle flies it, with its own estimator on board; not to be changed."""
    from fusetune.design.missions.mission import load_mission
    from fusetune.execute.simulation import fly
    from fusetune.execute.vehicle import load_vehicle
    from fusetune.px4.layouts.release_layouts import canonical

    mission = load_mission(project_root / "config/missions/survey.yaml")
    vehicle = load_vehicle(project_root / "config/vehicles/quadrotor.yaml")
    return canonical(fly(mission, vehicle, {}, seed=4, with_estimator=True))


@pytest.fixture(scope="session")
def golden_logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the golden flights' logs, unpacked; not to be changed."""
    from benchmarks.reference_flights import GOLDEN_LOGS, GOLDEN_REFERENCE, log_of, reference_folders

    folder = tmp_path_factory.mktemp("golden_logs")
    for reference in reference_folders(GOLDEN_REFERENCE):
        log_of(reference.name, GOLDEN_LOGS, folder)
    return folder


@pytest.fixture(scope="session")
def golden_reference() -> Path:
    """Folder of what PX4's own estimator computed on the golden flights."""
    from benchmarks.reference_flights import GOLDEN_REFERENCE

    return GOLDEN_REFERENCE


shared_logs = _shared_folder("logs", "real flight logs")
shared_reference = _shared_folder("reference", "PX4's own replays of the real logs")
shared_reference_releases = _shared_folder("reference_releases", "replays of the logs by other releases of PX4")
shared_reference_random = _shared_folder("reference_random", "PX4's own replays with random parameter sets")
shared_data = _shared_folder("data", "fact tables")
