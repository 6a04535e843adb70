from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from fusetune.checksum_file import check_checksum, checksum_file, has_checksum, write_checksum
from fusetune.errors import UserError


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "flights.csv").write_bytes(b"flight,status\nfirst,replayable\n")
    write_checksum(tmp_path / "flights.csv")
    return tmp_path / "flights.csv"


def test_the_checksum_is_that_of_sha256sum(file: Path) -> None:
    assert has_checksum(file)
    check_checksum(file, "Delete it")
    if shutil.which("sha256sum") is None:
        pytest.skip("needs sha256sum")
    subprocess.run(["sha256sum", "--check", checksum_file(file).name], cwd=file.parent, check=True)


def test_every_single_bit_that_flips_in_the_file_or_its_checksum_is_found(file: Path) -> None:
    for one, length in ((file, file.stat().st_size), (checksum_file(file), 64)):
        content = one.read_bytes()
        for position in range(length):
            for bit in range(8):
                damaged = bytearray(content)
                damaged[position] ^= 1 << bit
                if one is not file and damaged.lower() == content.lower():
                    continue  # hexadecimal digits mean the same as capitals
                one.write_bytes(damaged)
                with pytest.raises(UserError, match=r"flights\.csv: is damaged.*Delete it"):
                    check_checksum(file, "Delete it")
        one.write_bytes(content)


def test_a_checksum_made_from_another_folder_counts_and_what_is_none_does_not(file: Path) -> None:
    beside = checksum_file(file)
    beside.write_bytes(beside.read_bytes().split()[0].upper() + b"  downloads/flights.csv\n")
    assert has_checksum(file)
    check_checksum(file, "Delete it")
    beside.write_text("notes of somebody")
    assert not has_checksum(file)


@pytest.mark.parametrize("missing", [0, 1])
def test_a_missing_file_is_named(file: Path, missing: int) -> None:
    (file, checksum_file(file))[missing].unlink()
    with pytest.raises(UserError, match=r"flights\.csv: cannot be read"):
        check_checksum(file, "Delete it")
