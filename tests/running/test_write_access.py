from __future__ import annotations

import os
from pathlib import Path

import pytest

from fusetune.errors import UserError
from fusetune.running.write_access import others_may_write, others_may_write_below, take_write_access

SOMEBODY = 12345
as_root = pytest.mark.skipif(os.getuid() != 0, reason="only root gives files away")


@pytest.fixture
def code(tmp_path: Path) -> Path:
    """A folder of code that only its owner may write."""
    folder = tmp_path / "code"
    folder.mkdir(mode=0o755)
    return folder


@pytest.fixture
def kernels(tmp_path: Path) -> Path:
    """A folder below a cache that only its owner may write, with a file in it."""
    folder = tmp_path / "cache" / "kernels"
    for part in (folder.parent, folder):
        part.mkdir(mode=0o755)
    (folder / "kernel").write_bytes(b"machine code")
    (folder / "kernel").chmod(0o644)
    return folder


def test_what_only_its_owner_may_write_is_no_others(kernels: Path, code: Path) -> None:
    assert not others_may_write_below(kernels.parent, kernels, code)
    assert not others_may_write_below(kernels.parent, kernels / "to be made", code)


@pytest.mark.parametrize("mode", [0o775, 0o757, 0o1777])
@pytest.mark.parametrize("place", ["..", ".", "kernel"])
def test_a_right_of_others_is_found_on_the_way_in_the_folder_and_in_its_files(
    kernels: Path, code: Path, place: str, mode: int
) -> None:
    (kernels / place).chmod(mode)
    assert others_may_write_below(kernels.parent, kernels, code)


def test_who_may_write_the_code_may_write_its_kernels(kernels: Path, code: Path) -> None:
    kernels.chmod(0o775)
    code.chmod(0o775)
    assert not others_may_write(kernels, code)
    kernels.chmod(0o777)
    assert others_may_write(kernels, code)


@as_root
def test_another_group_than_that_of_the_code_is_others(kernels: Path, code: Path) -> None:
    for path in (kernels, code):
        path.chmod(0o775)
    os.chown(kernels, -1, SOMEBODY)
    assert others_may_write(kernels, code)


def test_the_right_is_taken_away_and_nothing_else(kernels: Path, code: Path) -> None:
    kernels.parent.chmod(0o777)
    kernels.chmod(0o770)
    take_write_access(kernels.parent, kernels / "new", code)
    modes = [path.stat().st_mode & 0o777 for path in (kernels.parent, kernels)]
    assert modes == [0o755, 0o750]
    assert not others_may_write_below(kernels.parent, kernels, code)


@as_root
def test_what_belongs_to_somebody_else_is_refused(kernels: Path, code: Path) -> None:
    os.chown(kernels, SOMEBODY, -1)
    assert others_may_write_below(kernels.parent, kernels, code)
    with pytest.raises(UserError, match="Delete it") as error:
        take_write_access(kernels.parent, kernels, code)
    assert error.value.file == str(kernels)
