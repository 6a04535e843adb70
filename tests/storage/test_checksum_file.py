from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from tests.flipped_bits import with_flipped_bits

from fusetune.errors import UserError
from fusetune.storage.checksum_file import check_checksum, checksum_file, write_checksum


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "flights.csv").write_bytes(b"flight,status\nfirst,replayable\n")
    write_checksum(tmp_path / "flights.csv")
    return tmp_path / "flights.csv"


def test_the_checksum_is_that_of_sha256sum(file: Path) -> None:
    assert checksum_file(file).is_file()
    check_checksum(file, "Delete it")
    if shutil.which("sha256sum") is None:
        pytest.skip("needs sha256sum")
    subprocess.run(["sha256sum", "--check", checksum_file(file).name], cwd=file.parent, check=True)


def test_every_single_bit_that_flips_in_either_file_is_found(file: Path) -> None:
    for one in (file, checksum_file(file)):
        content = one.read_bytes()
        for damaged in with_flipped_bits(content):
            one.write_bytes(damaged)
            with pytest.raises(UserError, match=r"flights\.csv: is damaged.*Delete it"):
                check_checksum(file, "Delete it")
        one.write_bytes(content)


@pytest.mark.parametrize("missing", [0, 1])
def test_a_missing_file_is_named(file: Path, missing: int) -> None:
    (file, checksum_file(file))[missing].unlink()
    with pytest.raises(UserError, match=r"flights\.csv: cannot be read"):
        check_checksum(file, "Delete it")
