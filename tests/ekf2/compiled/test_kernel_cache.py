from __future__ import annotations

import os
from pathlib import Path

import pytest

from fusetune.ekf2.compiled import kernel_cache
from fusetune.ekf2.compiled.kernel_cache import LOCATOR, use_kernel_cache
from fusetune.running import workflow_files


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A checkout that the package lies in, and an environment that says nothing of caches but the user's."""
    folder, home = tmp_path / "checkout", tmp_path / "home"
    (folder / "src" / "fusetune").mkdir(parents=True, mode=0o755)
    for path in (folder, folder / "src", folder / "src" / "fusetune"):
        path.chmod(0o755)
    (folder / "workflow").mkdir()
    (folder / "workflow" / "Snakefile").touch()
    for module in (kernel_cache, workflow_files):
        monkeypatch.setattr(module, "PACKAGE", folder / "src" / "fusetune")
    monkeypatch.setenv("XDG_CACHE_HOME", str(home))
    for name in ("NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES"):
        monkeypatch.setenv(name, "")
    return folder


def test_kernels_are_kept_below_the_checkout_and_nothing_is_made_yet(checkout: Path) -> None:
    folder = use_kernel_cache()
    assert folder.parent == checkout / ".cache" / "numba"
    assert os.environ["NUMBA_CACHE_DIR"] == str(folder)
    assert not (checkout / ".cache").exists()


@pytest.mark.parametrize("why", ["no checkout", "others may write to it", "this user may not"])
def test_otherwise_they_are_kept_in_the_users_cache(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, why: str
) -> None:
    if why == "no checkout":
        (checkout / "workflow" / "Snakefile").unlink()
    elif why == "others may write to it":
        checkout.chmod(0o777)
    else:
        monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != checkout)
    assert use_kernel_cache().parent == tmp_path / "home" / "fusetune" / "numba"


def test_a_process_keeps_to_the_cache_of_who_started_it_if_that_is_for_these_sources(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = use_kernel_cache()
    told = tmp_path / "elsewhere" / own.name
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(told))
    assert use_kernel_cache() == told
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "of another version"))
    assert use_kernel_cache() == own


def test_where_the_user_keeps_what_numba_compiles_a_folder_of_these_sources_is_taken(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Numba itself would hand out kernels of other sources from a folder that serves all programs and versions."""
    own = use_kernel_cache()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "of the user"))
    monkeypatch.setenv("NUMBA_CACHE_LOCATOR_CLASSES", "")
    assert use_kernel_cache() == tmp_path / "of the user" / "fusetune" / "numba" / own.name
    assert os.environ["NUMBA_CACHE_LOCATOR_CLASSES"] == LOCATOR
    assert use_kernel_cache() == tmp_path / "of the user" / "fusetune" / "numba" / own.name
