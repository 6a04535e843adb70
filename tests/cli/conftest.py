"""One folder of results for all sub-commands that read one."""

from __future__ import annotations

import pytest
from tests.apply.made_results import make_results

from fusetune.apply.results_folder import ResultsFolder


@pytest.fixture(scope="session")
def made_results(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Results of five flights with a better and a worse set; not to be changed."""
    return make_results(tmp_path_factory.mktemp("made") / "results")
