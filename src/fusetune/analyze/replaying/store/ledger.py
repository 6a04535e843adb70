"""Which replays of a flight are out of date, so that a job that handles many sets makes only those."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from fusetune.analyze.replaying.store.parts import replay_files
from fusetune.save.flight_folder import read_metadata
from fusetune.storage.files import AnyPath
from fusetune.storage.ledger import Ledger, key_of

LEDGER_FILE = ".replays.made.json"


class ReplayLedger:
    """The record of the replays of one flight, which one job makes.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    output_folder : holds the files of the replays
    made_with : what beside the log and the values of a set the replays follow from: settings, state of the sources
    """

    def __init__(self, flight_folder: AnyPath, output_folder: AnyPath, made_with: Any) -> None:
        self._folder = Path(output_folder)
        self._source = [read_metadata(flight_folder)["checksum"], made_with]
        self._ledger = Ledger(self._folder / LEDGER_FILE)

    def outdated(self, sets: Mapping[str, Mapping[str, float]]) -> dict[str, Mapping[str, float]]:
        """Those of the sets, name → values, whose files do not stand as they were made from just this."""
        return {
            name: values
            for name, values in sets.items()
            if not self._ledger.is_current(name, self._key(values), self._files(name))
        }

    def record(self, sets: Mapping[str, Mapping[str, float]]) -> None:
        """Enter sets that have just been replayed."""
        self._ledger.record_all({name: (self._key(values), self._files(name)) for name, values in sets.items()})

    def _key(self, values: Mapping[str, float]) -> str:
        return key_of([*self._source, dict(values)])

    def _files(self, name: str) -> Iterable[Path]:
        return replay_files(self._folder, name)
