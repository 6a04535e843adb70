"""Which parameters predict the flights of some logs best."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusetune.apply.search.answer import answer_lines
from fusetune.apply.search.log_search import search_logs
from fusetune.design.search_settings import SearchSettings
from fusetune.report.search_results import read_search
from fusetune.running.worker_processes import all_cores
from fusetune.settings.checking import checked
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes
    ----------
    parameters : the few worth changing, name → value; empty where nothing is better beyond chance
    answer : what was found, in sentences, the answer first
    document : all of it, as `search.json` holds it (docs/search.md)
    folder : holds `best_params.params`, `search.json` and the rest; None where none was asked for
    """

    parameters: dict[str, float]
    answer: str
    document: dict[str, Any]
    folder: Path | None

    def __str__(self) -> str:
        return self.answer


def search(
    logs: Sequence[AnyPath],
    parameters: Sequence[str] | None = None,
    *,
    folder: AnyPath | None = None,
    settings: Mapping[str, Any] | None = None,
    cores: int | None = None,
    told: Callable[[str], None] | None = None,
) -> Found:
    """Search for the parameters of the vehicle that flew the newest of some logs.

    Parameters
    ----------
    logs : `.ulg` files, each with a file name of its own
    parameters : names of those that may change; by default those that the flights exercise
    folder : takes all files, new or of a search that was stopped, which goes on; by default nothing is kept
    settings : how to search, with the keys of docs/search.md, e.g. ``{"evaluations": 200, "seed": 2}``
    cores : processes that replay; by default all cores
    told : is given lines on how far it is, e.g. ``print``

    Raises
    ------
    UserError
        No log can be used, a parameter cannot be searched, or the folder holds what is no search's.
    """
    document = dict(settings or {}) | ({} if parameters is None else {"parameters": list(parameters)})
    checked_settings = checked(SearchSettings, document, "search: settings")
    with tempfile.TemporaryDirectory(prefix="fusetune_search_") as scratch:
        target = Path(scratch if folder is None else folder)
        search_logs(
            logs, target, checked_settings, processes=cores or all_cores(), told=told or (lambda line: None),
            asked_in="search: settings",
        )  # fmt: skip
        results = read_search(target)
    lines = answer_lines(results.search, results.decision, results.sensitivity.sentences)
    return Found(
        parameters=_values(results.search),
        answer="\n".join(lines),
        document=results.search,
        folder=None if folder is None else target,
    )


def _values(document: Mapping[str, Any]) -> dict[str, float]:
    return dict(document["parameters_found"])
