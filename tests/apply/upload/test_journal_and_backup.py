from __future__ import annotations

import zlib
from pathlib import Path

import pytest
from benchmarks.upload_trials.made_decision import made_values

from fusetune.apply.upload.backup import read_backup, write_backup
from fusetune.apply.upload.journal import JOURNAL, Change, Journal, NothingPlanned, Record, read_journal
from fusetune.apply.upload.parameter_server import Listing, checksum_of
from fusetune.apply.upload.values import Value
from fusetune.apply.upload.vehicles import Identity
from fusetune.errors import UserError
from fusetune.px4.parameters.params_file import read_params

CHANGES = (
    Change("EKF2_GPS_DELAY", Value.of("FLOAT", 110.0), Value.of("FLOAT", 40.0), True),
    Change("EKF2_GPS_CHECK", Value.of("INT32", 1023), Value.of("INT32", 21)),
)


def written(folder: Path) -> bytes:
    journal = Journal(folder)
    journal.begin(Record("upload", "best_params.params", "ab" * 18, "v1.16.0", 1, CHANGES))
    journal.write("sending", name="EKF2_GPS_DELAY", value="42200000")
    journal.write("going back", why="the vehicle is armed")
    journal.close()
    return (folder / JOURNAL).read_bytes()


def test_a_journal_that_ends_at_any_byte_tells_what_was_whole_and_goes_on(tmp_path: Path) -> None:
    whole = written(tmp_path)
    first, second = (len(b"".join(whole.splitlines(keepends=True)[:count])) for count in (1, 2))
    for length in sorted({*range(0, len(whole), 9), first - 1, first, second - 1, second, len(whole)}):
        (tmp_path / JOURNAL).write_bytes(whole[:length])
        if length < first:
            with pytest.raises(NothingPlanned):
                read_journal(tmp_path)
            continue
        record = read_journal(tmp_path)
        assert record.changes == CHANGES
        assert record.sent == (["EKF2_GPS_DELAY"] if length >= second else [])
        assert record.goal == ("old" if length == len(whole) else "new")
        if length % 90 == 0:
            journal = Journal(tmp_path)
            journal.write("ended", **{"with": "old"})
            journal.close()
            assert read_journal(tmp_path).ended == "old"


def test_a_changed_line_shows_and_one_process_at_a_time_writes(tmp_path: Path) -> None:
    whole = written(tmp_path)
    (tmp_path / JOURNAL).write_bytes(whole.replace(b"sending", b"seeding"))
    with pytest.raises(UserError, match="damaged at line 2"):
        read_journal(tmp_path)
    (tmp_path / JOURNAL).write_bytes(whole)
    journal = Journal(tmp_path)
    with pytest.raises(UserError, match="in use"):
        Journal(tmp_path)
    journal.close()


def test_a_backup_gives_every_bit_back_and_is_quietly_a_file_of_qgroundcontrol(tmp_path: Path) -> None:
    values = {name: Value(kind, bits) for name, (kind, bits) in made_values(200).items()}  # type: ignore[arg-type]
    values["TST_SNAN"] = Value("FLOAT", 0x7F800001)
    identity = Identity(7, 1, "ab" * 18, "v1.16.0", "0123456789", "bytewise")
    write_backup(tmp_path / "backup.params", identity, Listing(values, None))
    backup = read_backup(tmp_path / "backup.params")
    assert (backup.uuid, backup.release) == (identity.uuid, identity.release)
    assert backup.values == values
    entries = {entry.name for entry in read_params(tmp_path / "backup.params")}
    assert entries == set(values) - {"TST_NAN", "TST_SNAN"}


def test_the_checksum_is_nuttx_crc32part() -> None:
    """Bit by bit as the polynomial 0xEDB88320 has it, from zero and without inverting."""
    values = {"EKF2_EN": Value.of("INT32", 1), "EKF2_TAU_POS": Value.of("FLOAT", 0.25)}
    crc = 0
    for byte in b"EKF2_EN\x01\0\0\0" + b"EKF2_TAU_POS\0\0\x80\x3e":
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
    assert checksum_of(values) == crc != zlib.crc32(b"EKF2_EN\x01\0\0\0EKF2_TAU_POS\0\0\x80\x3e")
    listing = Listing(values, crc)
    now = Value.of("FLOAT", 0.5)
    assert listing.agrees
    assert listing.is_changed_only_by({"EKF2_TAU_POS": now}, checksum_of({**values, "EKF2_TAU_POS": now}))
    assert listing.is_changed_only_by({"EKF2_TAU_POS": now}, crc) is False
    assert Listing(values, 1).is_changed_only_by({}, 1) is None
