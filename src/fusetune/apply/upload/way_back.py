"""Values to go back to: of a backup, or of the pipeline's `rollback.params`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from fusetune.apply.upload.backup import read_backup
from fusetune.apply.upload.journal import BACKUP, JOURNAL, read_journal
from fusetune.apply.upload.judged import DECISION, Judged, read_judged
from fusetune.apply.upload.refusals import refuse_foreign
from fusetune.apply.upload.stops import Refusal
from fusetune.apply.upload.values import Value
from fusetune.apply.upload.vehicles import Identity
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class WayBack:
    """Values to go back to, and of whom they are."""

    file: Path
    values: Mapping[str, Value]
    of: Judged | tuple[str, str]
    """The decision, or id and release of a backup."""


def read_way_back(file: AnyPath) -> WayBack:
    """Read the values of a backup, of the folder of an upload, or of `rollback.params` with its decision beside it.

    Of a backup that lies beside the journal of its upload they are those that the upload was to change, of a backup
    alone all that the vehicle had.

    Raises
    ------
    UserError
        A file cannot be used.
    """
    file = Path(file)
    if file.is_dir():
        file = file / BACKUP
    if file.with_name(DECISION).exists():
        judged = read_judged(file)
        return WayBack(file, judged.wanted, judged)
    backup = read_backup(file)
    values = backup.values
    if file.with_name(JOURNAL).exists():
        touched = [change.name for change in read_journal(file.parent).changes]
        values = {name: values[name] for name in touched if name in values}
    return WayBack(file, values, (backup.uuid, backup.release))


def refuse_other(way_back: WayBack, identity: Identity) -> None:
    """Raises `Refusal` where the vehicle, or its release, is not the one whose values these are."""
    of = way_back.of
    if isinstance(of, Judged):
        refuse_foreign(of, identity)
    elif of != (identity.uuid, identity.release):
        raise Refusal(
            f"the backup is of board {of[0] or 'that tells no id'} with PX4 {of[1]}, and this is {identity.in_words}",
            "Connect that vehicle, with that release",
        )
