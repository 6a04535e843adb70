"""All parameters of a vehicle in one file for QGroundControl, before the first is written, to the bit.

18 decimals hold all bits of a float32 but of the smallest ones, and QGroundControl's form has no numbers that are none:
such values are told as bits in a comment, which `read_backup` minds.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from fusetune.apply.upload.parameter_server import Listing
from fusetune.apply.upload.values import Value
from fusetune.apply.upload.vehicles import Identity
from fusetune.errors import UserError
from fusetune.px4.parameters.params_file import (
    ParamEntry,
    ParamsHeader,
    VehicleAddress,
    read_params,
    write_params,
)
from fusetune.storage.files import AnyPath

_BITS = re.compile(r"bits 0x([0-9a-f]{8})")
_NO_NUMBER = re.compile(r"# no number: (\S+) 0x([0-9a-f]{8})")
_BOARD = re.compile(r"# board (\S*), release (\S+)")
_SMALLEST_WRITTEN = 1e-9
"""Below, 18 decimals are fewer than the nine digits that tell float32s apart."""


@dataclass(frozen=True)
class Backup:
    """What a backup holds.

    Attributes
    ----------
    uuid, release : of the vehicle, as `Identity` has them
    values : by name
    """

    uuid: str
    release: str
    values: Mapping[str, Value]


def write_backup(path: AnyPath, identity: Identity, listing: Listing) -> None:
    """Write all parameters of a vehicle; when this returns, the file is on the disk under its name."""
    path = Path(path)
    version, _, stage = identity.release.removeprefix("v").partition("-")
    odd = [(name, value) for name, value in listing.values.items() if not math.isfinite(value.number)]
    agrees = {True: "which is that of these values", None: "which was not compared"}[listing.agrees]
    checksum = "none told" if listing.checksum is None else f"0x{listing.checksum:08x}, {agrees}"
    comments = (
        f"fusetune: all {len(listing.values)} parameters of the vehicle, before anything was written",
        f"board {identity.uuid}, release {identity.release}",
        f"the vehicle's checksum: {checksum}",
        *(f"no number: {name} 0x{value.bits:08x}" for name, value in odd),
    )
    entries = [_entry(name, value) for name, value in listing.values.items() if math.isfinite(value.number)]
    header = ParamsHeader(version=version, stage=stage, git_revision=identity.git, comments=comments)
    write_params(path, entries, header, VehicleAddress(identity.system, identity.component))
    sync_folder(path.parent)


def read_backup(path: AnyPath) -> Backup:
    """Read what `write_backup` wrote; raises `UserError` where it is no such file."""
    path = Path(path)
    values = {entry.name: _value(entry) for entry in read_params(path)}
    text = path.read_text(encoding="utf-8")
    board = _BOARD.search(text)
    if board is None:
        raise UserError(path, "does not say of which vehicle it is", "Give the backup.params of an upload, unchanged")
    values |= {name: Value("FLOAT", int(bits, 16)) for name, bits in _NO_NUMBER.findall(text)}
    return Backup(board[1], board[2], values)


def sync_folder(folder: AnyPath) -> None:
    """See that the names in a folder are on the disk, where the system can."""
    folder = Path(folder)
    if os.name == "posix":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _entry(name: str, value: Value) -> ParamEntry:
    small = value.type == "FLOAT" and value.bits and abs(value.number) < _SMALLEST_WRITTEN
    return ParamEntry(name, value.number, value.type, (f"bits 0x{value.bits:08x}",) if small else ())


def _value(entry: ParamEntry) -> Value:
    for comment in entry.comments:
        if told := _BITS.fullmatch(comment):
            return Value(entry.type, int(told[1], 16))
    return Value.of(entry.type, entry.value)
