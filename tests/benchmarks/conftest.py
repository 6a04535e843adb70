"""The benchmarks are no part of the installed package; tests of theirs import them from the project's root."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def benchmarks(project_root: Path) -> Iterator[None]:
    """`import benchmarks.…` works."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(project_root)
        yield
    sys.modules.pop("benchmarks", None)
