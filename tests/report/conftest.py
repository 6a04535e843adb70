"""One made report for all tests that only look at it."""

from pathlib import Path

import pytest
from tests.report.made_report import SETS, make_report


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Folder of the study and the page."""
    root = tmp_path_factory.mktemp("report")
    return root, make_report(root, SETS, flights=5)
