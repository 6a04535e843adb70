"""Kernels that a package carries are taken where they fit, as they were compiled, and nowhere else."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest
from numba.core import config
from numba.core.serialize import dumps
from tests.ekf2.compiled.test_compilation import LOADS

from fusetune.ekf2.compiled import carried_kernels, compilation
from fusetune.ekf2.compiled.carried_kernels import carried_folder, has_level, take_over
from fusetune.ekf2.compiled.compilation import RECORD_NAME, ensure_compiled, kernel_folder
from fusetune.ekf2.compiled.kernel_cache import LOCATOR
from fusetune.ekf2.replay.warm_up import compile_kernels

ANOTHER = ("x86_64-unknown-linux-gnu", "another", "+sse2")
Kept = tuple[Path, Path, list[list[str]]]


def record(folder: Path) -> None:
    (folder / RECORD_NAME).unlink(missing_ok=True)
    compilation._record(folder)


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Kept:
    """Carried kernels, as for another processor; an empty cache; and the options of the processes that are started."""
    if config.DISABLE_JIT:
        pytest.skip("Numba is switched off")
    compile_kernels()
    carried, caches = tmp_path / "carried", tmp_path / "cache"
    carried.mkdir(mode=0o755)
    take_over(kernel_folder(), carried, ANOTHER)
    record(carried)
    options: list[list[str]] = []
    start = compilation._compile

    def started(caches: Path, *given: str) -> int:
        options.append([*given])
        return start(caches, *given) if compilation.ONLY_LOADS in given else 1

    monkeypatch.setattr(compilation, "_compile", started)
    monkeypatch.setattr(compilation, "carried_folder", lambda: carried)
    monkeypatch.setattr(carried_kernels, "has_level", lambda: True)
    monkeypatch.setattr(config, "CACHE_DIR", str(caches))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(caches))
    monkeypatch.setenv("NUMBA_CACHE_LOCATOR_CLASSES", LOCATOR)
    ensure_compiled.cache_clear()
    return carried, kernel_folder(), options


def test_what_fits_is_loaded_and_nothing_is_compiled(kept: Kept) -> None:
    _, folder, options = kept
    ensure_compiled()
    assert options == [[compilation.ONLY_LOADS]]
    assert (folder / RECORD_NAME).is_file()
    command = [sys.executable, "-c", LOADS]
    printed = subprocess.run(command, env=os.environ, check=True, stdout=subprocess.PIPE, text=True).stdout
    assert printed.split()[1:] == ["1", "0"]
    ensure_compiled.cache_clear()
    ensure_compiled()
    assert len([one for one in options if one == [compilation.ONLY_LOADS]]) == 1


@pytest.mark.parametrize("why", ["level", "told", "byte", "writable", "absent"])
def test_what_does_not_fit_is_not_even_tried(kept: Kept, monkeypatch: pytest.MonkeyPatch, why: str) -> None:
    carried, folder, options = kept
    code = next(carried.glob("*.nbc"))
    if why == "level":
        monkeypatch.setattr(carried_kernels, "has_level", has_level)
        # what an x86-64-v2 has
        features = dict.fromkeys(carried_kernels.FEATURES, True) | {"avx2": False}
        monkeypatch.setattr(carried_kernels.llvm, "get_host_cpu_features", lambda: features)
    elif why == "told":
        monkeypatch.setattr(config, "CPU_NAME", "x86-64-v2")
    elif why == "byte":
        content = bytearray(code.read_bytes())
        content[len(content) // 2] ^= 1
        code.write_bytes(content)
    elif why == "writable":
        code.chmod(0o666)
    else:
        monkeypatch.setattr(compilation, "carried_folder", lambda: carried / "of other sources")
    ensure_compiled()
    assert options == [[], [compilation.PLAIN]]
    assert list(folder.iterdir()) == []


def test_what_another_byte_code_was_compiled_from_is_refused_by_who_tries_it(kept: Kept) -> None:
    carried, folder, options = kept
    for index in carried.glob("*.nbi"):
        with open(index, "rb") as file:
            version, (stamp, overloads) = pickle.load(file), pickle.loads(file.read())
        other = {
            (signature, processor, ("0" * 64, code[1])): n for (signature, processor, code), n in overloads.items()
        }
        with open(index, "wb") as file:
            pickle.dump(version, file, protocol=-1)
            file.write(dumps((stamp, other)))
    record(carried)
    ensure_compiled()
    assert options == [[compilation.ONLY_LOADS], [], [compilation.PLAIN]]
    assert list(folder.iterdir()) == []


def test_they_are_found_by_all_that_machine_code_follows_from(monkeypatch: pytest.MonkeyPatch) -> None:
    places = {carried_folder()}
    for owner, name, other in (
        (carried_kernels.numba, "__version__", "0.0"),
        (carried_kernels.llvmlite, "__version__", "0.0"),
        (carried_kernels, "digest_of_sources", lambda: "0" * 16),
        (carried_kernels.llvm, "get_process_triple", lambda: "aarch64-unknown-linux-gnu"),
        (carried_kernels, "LEVEL", "x86-64-v4"),
    ):
        with monkeypatch.context() as changed:
            changed.setattr(owner, name, other)
            places.add(carried_folder())
    assert len(places) == 6
