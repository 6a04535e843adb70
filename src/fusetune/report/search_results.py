"""What the pages read of a search: what was found, what was tried, and what it tells of the parameters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusetune.apply.sensitivity.files import SENSITIVITY_FILE, ToldSensitivity, read_sensitivity
from fusetune.apply.trials import Trials
from fusetune.apply.trials_file import TRIALS_FILE, read_trials
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

SEARCH_FILE = "search.json"


@dataclass(frozen=True)
class SearchResults:
    """Everything behind what is shown of a search.

    Attributes
    ----------
    search : `search.json`
    decision : `decision.json` beside it
    trials : what the search on all flights tried; None where nothing was varied
    sensitivity : what that tells of the parameters
    """

    search: dict[str, Any]
    decision: dict[str, Any]
    trials: Trials | None
    sensitivity: ToldSensitivity

    @property
    def parts(self) -> list[dict[str, Any]]:
        """The searches that kept a part of the flights aside, in order of time."""
        return [one for one in self.search["searches"] if one["kept_aside"]]

    @property
    def is_change(self) -> bool:
        """Whether the decision changes anything."""
        return bool(self.decision["status"] == "change")


def read_search(folder: AnyPath) -> SearchResults:
    """Read a search's folder; `UserError` where a file is missing or damaged."""
    folder = Path(folder)
    return SearchResults(
        search=read_document(folder / SEARCH_FILE),
        decision=read_document(folder / "decision.json"),
        trials=read_trials(folder / TRIALS_FILE),
        sensitivity=read_sensitivity(folder / SENSITIVITY_FILE),
    )
