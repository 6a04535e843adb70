"""The folders of uploads: a new one, and those of uploads that have not ended."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from fusetune.apply.upload.backup import sync_folder
from fusetune.apply.upload.journal import JOURNAL, Journal, NothingPlanned, Record, read_journal
from fusetune.apply.upload.stops import Refusal
from fusetune.apply.upload.vehicles import Identity
from fusetune.errors import UserError
from fusetune.storage.files import AnyPath


def new_folder(folder: AnyPath, identity: Identity) -> Path:
    """Make the folder of a new upload, named by time and board."""
    folder = Path(folder)
    name = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}_{identity.uuid[-8:] or 'unknown'}"
    for number in range(1, 1000):
        made = folder / (name if number == 1 else f"{name}_{number}")
        try:
            made.mkdir(parents=True)
        except FileExistsError:
            continue
        sync_folder(folder)
        return made
    raise UserError(folder, "is full of uploads of this second", "Wait a second")


def unended(folder: AnyPath) -> Iterator[tuple[Path, Record]]:
    """Folders of uploads that have not ended, the newest first."""
    folder = Path(folder)
    for one in sorted((path.parent for path in folder.glob(f"*/{JOURNAL}")), reverse=True):
        try:
            record = read_journal(one)
        except NothingPlanned:
            continue
        if not record.ended:
            yield one, record


def refuse_unended(folder: AnyPath, identity: Identity) -> None:
    """Raises `Refusal` where an upload to this vehicle that has sent something has not ended."""
    for one, record in unended(folder):
        if record.uuid == identity.uuid and record.sent:
            raise Refusal(
                f"an upload to this vehicle is not finished: {one}",
                f"Go on with it by --resume --folder {one}, or take it back by --rollback {one}",
            )


def end_others(folder: AnyPath, identity: Identity, names: set[str], by: AnyPath | None) -> None:
    """Unfinished uploads whose parameters have all been taken back by another one have ended, too."""
    for one, record in unended(folder):
        if record.uuid == identity.uuid and names >= {change.name for change in record.changes}:
            journal = Journal(one)
            journal.write("ended", **{"with": "old", "by": str(by)})
            journal.close()


def newest_unended(folder: AnyPath) -> Path:
    """The folder of the newest upload that has not ended; raises `UserError` where all have."""
    folder = Path(folder)
    for one, _ in unended(folder):
        return one
    raise UserError(folder, "holds no upload that has not ended", "There is nothing to go on with")
