"""Files that hold one replay: `<set>.innovations.parquet`, `.states`, `.local_position`, `.status_flags`, `.json`.

Beside them `.withheld` and `.gaps` hold what the filter predicted while a sensor was withheld from it.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa

from fusetune.analyze.replaying.row_groups import ROWS_PER_GROUP, replay_table_options, written_in_groups
from fusetune.analyze.replaying.withheld_gaps import gap_table, prediction_table
from fusetune.ekf2.replay.recording import FLAGS_ROW, INNOVATION_ROW, LOCAL_POSITION_ROW, STATE_ROW, RecordArrays
from fusetune.ekf2.replay.replay_tables import flags_table, innovation_table, local_position_table, state_table
from fusetune.ekf2.replay.results import ReplaySummary
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.parquet import write_table

TABLES = {
    "innovations": (INNOVATION_ROW, innovation_table),
    "states": (STATE_ROW, state_table),
    "local_position": (LOCAL_POSITION_ROW, local_position_table),
    "status_flags": (FLAGS_ROW, flags_table),
}
"""What is written as the replay goes, in the order of `RecordArrays`: dtype of its rows, and columns of them."""

GAP_TABLES = {"withheld": prediction_table, "gaps": gap_table}
"""What is written at its end."""

BASELINE = "v1.16"


@dataclass(frozen=True)
class ReplayIdentity:
    """What was replayed."""

    set: str
    overrides: Mapping[str, float]
    params: Mapping[str, float]
    inputs: Mapping[str, Any] | None = None
    """How the replay started and what was reconstructed for it; stands in the JSON file."""


def replay_files(folder: AnyPath, set_name: str) -> list[Path]:
    """All files of one replay."""
    folder = Path(folder)
    return [folder / f"{set_name}.{table}.parquet" for table in (*TABLES, *GAP_TABLES)] + [folder / f"{set_name}.json"]


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
        if all(measured(rows).all() for rows in self._spooled()):
            to_table = innovation_table
        else:

            def to_table(rows: np.ndarray) -> pa.Table:
                return innovation_table(rows).append_column("measured", pa.array(measured(rows)))

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
    targets = {name: folder / f"{set_name}.{name}.parquet" for name in TABLES}
    with ExitStack() as stack:
        spool = stack.enter_context(tempfile.TemporaryFile(dir=folder)) if told_apart else None
        takers = [
            stack.enter_context(written_in_groups(targets[name], *table))
            for name, table in TABLES.items()
            if spool is None or name != "innovations"
        ]
        yield ReplayWriter(takers, spool, targets["innovations"])


def finish_replay(folder: AnyPath, identity: ReplayIdentity, summary: ReplaySummary) -> None:
    """Write what the replay predicted in gaps, and last the JSON that says the set is complete."""
    folder = Path(folder)
    for name, to_table in GAP_TABLES.items():
        table = to_table(summary.gaps)
        with atomic_path(folder / f"{identity.set}.{name}.parquet") as path:
            write_table(table, path, **replay_table_options(table.schema))
    with atomic_path(folder / f"{identity.set}.json") as path:
        write_document(path, _summary(identity, summary))


def _why_not_started(result: ReplaySummary) -> str:
    if result.levelled:
        return "the IMU samples end before the fusion time horizon has moved"
    return "the filter never found the vehicle still enough to take its tilt"


def _summary(identity: ReplayIdentity, result: ReplaySummary) -> dict[str, object]:
    status, reason = ("diverged", "a state or variance is no finite number") if result.diverged else ("ok", "")
    if not result.updates:
        status, reason = "not_started", _why_not_started(result)
    origin = None
    if result.origin is not None:
        origin = dict(zip(("latitude_deg", "longitude_deg", "altitude_m"), result.origin, strict=True))
    return {
        "version": BASELINE,
        "set": identity.set,
        "overrides": dict(identity.overrides),
        "status": status,
        "reason": reason,
        "n_imu": result.imu_samples,
        "n_updates": result.updates,
        "mode": result.mode,
        **(identity.inputs or {}),
        "resets": dict(result.resets),
        "filter_fault_flags_max": result.filter_fault_flags_max,
        "origin": origin,
        "params": dict(identity.params),
    }
