"""Replays of a flight as files: of the present set, and of what flew where that is another replay."""

from __future__ import annotations

import filecmp
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fusetune.analyze.replaying.replayed_set import values_of
from fusetune.analyze.replaying.store.parts import summary_file, table_file
from fusetune.analyze.replaying.store.reader import read_columns
from fusetune.px4.flight import TopicTable
from fusetune.report.flight_data.innovation_panels import Innovations, recorded_innovations
from fusetune.set_names import AS_FLOWN
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

_INNOVATIONS = "innovations"


@dataclass(frozen=True)
class Replay:
    """The files of a replay, each read when it is asked for."""

    folder: Path
    name: str

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """How it went, see `fusetune.analyze.replaying.replay_summary`."""
        return read_document(summary_file(self.folder, self.name))

    @property
    def parameters(self) -> Mapping[str, float]:
        """All that the estimator had."""
        return values_of(self.summary, "params")

    @cached_property
    def innovations(self) -> Innovations:
        """By source and axis."""
        return recorded_innovations(table_file(self.folder, self.name, _INNOVATIONS))

    @cached_property
    def local_position(self) -> TopicTable:
        """What the output predictor published."""
        return read_columns(table_file(self.folder, self.name, "local_position"))

    @cached_property
    def status_flags(self) -> TopicTable:
        """Flags at their changes, and once a second."""
        return read_columns(table_file(self.folder, self.name, "status_flags"))

    def states(self, columns: list[str]) -> TopicTable:
        """Some columns of the states."""
        return read_columns(table_file(self.folder, self.name, "states"), columns)


def replays_of(folder: AnyPath, scoring: Mapping[str, Any] | None) -> tuple[Replay, ...]:
    """The present set's first; none where nothing was replayed.

    Parameters
    ----------
    folder : `results/analyze/<flight>`
    scoring : its `scoring.json`
    """
    if scoring is None:
        return ()
    folder = Path(folder)
    present = scoring["present"]
    if not table_file(folder, present, _INNOVATIONS).exists():
        return ()
    flown = table_file(folder, AS_FLOWN, _INNOVATIONS)
    # sets with the same parameters have one replay, of which the files are the same
    other = flown.exists() and not filecmp.cmp(flown, table_file(folder, present, _INNOVATIONS), shallow=False)
    return (Replay(folder, present), Replay(folder, AS_FLOWN)) if other else (Replay(folder, present),)
