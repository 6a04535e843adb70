"""Writes the files of one replay, most of them while it goes on."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow as pa

from fusetune.analyze.replaying.replay_summary import ReplayIdentity, summary_document
from fusetune.analyze.replaying.store.columns import PREDICTED_TABLES, RECORDED_TABLES, innovation_table
from fusetune.analyze.replaying.store.parts import summary_file, table_file
from fusetune.analyze.replaying.store.row_groups import ROWS_PER_GROUP, replay_table_options, written_in_groups
from fusetune.ekf2.replay.recording import INNOVATION_ROW, RecordArrays
from fusetune.ekf2.replay.results import ReplaySummary
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.parquet import write_table


class ReplayWriter:
    """Takes the rows of a replay while it goes on; `replay_writer` makes one."""

    def __init__(self, takers: Sequence[Callable[[np.ndarray], None]], spool: BinaryIO | None, innovations: AnyPath):
        self._takers, self._spool, self._innovations = takers, spool, innovations

    def take(self, rows: RecordArrays) -> None:
        """Write the rows of a stretch."""
        if self._spool is not None:
            self._spool.write(rows.innovations.tobytes())
        for taker, part in zip(self._takers, rows[-len(self._takers) :], strict=True):
            taker(part)

    def write_spooled(self, measured: Callable[[np.ndarray], np.ndarray]) -> None:
        """Write the innovations that were waiting to be told apart.

        Parameters
        ----------
        measured : tells of innovation rows whether the measurement of each stands in the log. The column `measured` is
            written only where some do not.
        """
        all_measured = all(measured(rows).all() for rows in self._spooled())

        def to_table(rows: np.ndarray) -> pa.Table:
            return innovation_table(rows, None if all_measured else measured(rows))

        with written_in_groups(self._innovations, INNOVATION_ROW, to_table) as take:
            for rows in self._spooled():
                take(rows)

    def _spooled(self) -> Iterator[np.ndarray]:
        assert self._spool is not None, "the innovations were written as they came"
        self._spool.seek(0)
        while content := self._spool.read(ROWS_PER_GROUP * INNOVATION_ROW.itemsize):
            yield np.frombuffer(content, INNOVATION_ROW)


@contextmanager
def replay_writer(folder: AnyPath, set_name: str, *, told_apart: bool = False) -> Iterator[ReplayWriter]:
    """Write the tables of a replay while it goes on; each appears when all are whole.

    Parameters
    ----------
    told_apart : whether some samples may have been reconstructed. Which ones can be told only at the end of the replay,
        so the innovations wait on the disk, and `ReplayWriter.write_spooled` must be called.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    targets = {name: table_file(folder, set_name, name) for name in RECORDED_TABLES}
    with ExitStack() as stack:
        spool = stack.enter_context(tempfile.TemporaryFile(dir=folder)) if told_apart else None
        takers = [
            stack.enter_context(written_in_groups(targets[name], *table))
            for name, table in RECORDED_TABLES.items()
            if spool is None or name != "innovations"
        ]
        yield ReplayWriter(takers, spool, targets["innovations"])


def finish_replay(folder: AnyPath, identity: ReplayIdentity, summary: ReplaySummary) -> None:
    """Write what the replay predicted in gaps, and last the JSON that says the set is complete."""
    for name, to_table in PREDICTED_TABLES.items():
        table = to_table(summary.gaps)
        with atomic_path(table_file(folder, identity.set, name)) as path:
            write_table(table, path, **replay_table_options(table.schema))
    with atomic_path(summary_file(folder, identity.set)) as path:
        write_document(path, summary_document(identity, summary))
