"""A folder of results as the pipeline leaves it: what lies where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fusetune.errors import UserError
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table


@dataclass(frozen=True)
class ResultsFolder:
    """What a run made; nothing is read before it is asked for.

    Attributes
    ----------
    path : the folder that holds `apply/`, `analyze/`, `save/` and `report.html`
    """

    path: Path

    @property
    def decision_file(self) -> Path:
        """The decision in figures."""
        return self.path / "apply" / "decision.json"

    @property
    def flights_table(self) -> Path:
        """All logs with their verdicts."""
        return self.path / "save" / "flights.parquet"

    @cached_property
    def decision(self) -> dict[str, Any]:
        """What `decision.json` holds."""
        return read_document(self.decision_file)

    @cached_property
    def flights(self) -> list[dict[str, Any]]:
        """A row for each log."""
        return read_table(self.flights_table).to_pylist()

    @property
    def replayable(self) -> list[str]:
        """Flights that can be replayed, in the order of the table."""
        return [row["flight"] for row in self.flights if row["status"] == "replayable"]

    @property
    def analyzed(self) -> list[Path]:
        """Folders of their scores."""
        return [self.path / "analyze" / flight for flight in self.replayable]

    def diagnoses(self, flights: Sequence[str]) -> list[Path]:
        """What is wrong on each of some flights, where it was told."""
        return [one for flight in flights if (one := self.path / "analyze" / flight / "diagnosis.json").is_file()]

    def optional(self, *parts: str) -> Path | None:
        """A file that not every run makes."""
        file = self.path.joinpath(*parts)
        return file if file.is_file() else None


def results_folder(path: AnyPath) -> ResultsFolder:
    """The results in a folder, or in `results` below it.

    Raises
    ------
    UserError
        It holds no decision.
    """
    path = Path(path)
    for folder in (path, path / "results"):
        found = ResultsFolder(folder)
        if found.decision_file.is_file():
            return found
    reason = "holds no apply/decision.json" if path.is_dir() else "is no folder"
    raise UserError(path, reason, "Name the folder results that a run made")
