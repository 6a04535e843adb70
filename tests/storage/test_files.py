"""Files appear whole or not at all; the digest of the sources changes with them."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusetune.errors import UserError
from fusetune.storage import digest
from fusetune.storage.files import atomic_path


def test_file_appears_with_its_content(tmp_path: Path) -> None:
    with atomic_path(tmp_path / "new" / "table.csv") as temporary:
        assert temporary.suffix == ".csv"
        temporary.write_text("a,b\n")
        assert not (tmp_path / "new" / "table.csv").exists()
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["table.csv"]
    assert (tmp_path / "new" / "table.csv").read_text() == "a,b\n"


def test_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("old")
    with pytest.raises(FileExistsError), atomic_path(tmp_path / "table.csv") as temporary:
        (temporary.write_text("half"), (tmp_path / "table.csv").touch(exist_ok=False))
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]
    assert (tmp_path / "table.csv").read_text() == "old"


def test_body_that_writes_nothing_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_path(tmp_path / "table.csv"):
        pass


def test_error_tells_file_reason_and_remedy() -> None:
    error = UserError(Path("flights/a.ulg"), "is empty", "Copy it again")
    assert str(error) == "flights/a.ulg: is empty. Copy it again."
    assert (error.file, error.reason, error.remedy) == ("flights/a.ulg", "is empty", "Copy it again")


def test_digest_follows_names_and_contents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(digest, "_PACKAGE_FOLDER", tmp_path)
    for folder in ("px4", "ekf2"):
        (tmp_path / folder / "__pycache__").mkdir(parents=True)
        (tmp_path / folder / "module.py").write_text("x = 1\n")
    before = digest.source_digest("px4", "ekf2")
    assert digest.source_digest("ekf2", "px4") == before
    assert digest.source_digest("px4") != before
    (tmp_path / "px4" / "__pycache__" / "module.pyc").write_bytes(b"compiled")
    assert digest.source_digest("px4", "ekf2") == before
    (tmp_path / "px4" / "data.csv").write_text("1\n")
    with_data = digest.source_digest("px4", "ekf2")
    assert with_data != before
    (tmp_path / "px4" / "data.csv").rename(tmp_path / "px4" / "other.csv")
    assert digest.source_digest("px4", "ekf2") not in (before, with_data)
    with pytest.raises(FileNotFoundError, match="absent"):
        digest.source_digest("absent")
