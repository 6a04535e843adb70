"""Compiled kernels are taken where they are those of these sources and this processor, and nowhere else."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from numba.core import config

import fusetune
from fusetune.ekf2.compiled import compilation, kernel_cache
from fusetune.ekf2.compiled.compilation import ensure_compiled
from fusetune.ekf2.compiled.kernel_locator import KernelLocator
from fusetune.ekf2.replay import loop
from fusetune.ekf2.replay.warm_up import compile_kernels
from fusetune.errors import UserError
from fusetune.storage.file_lock import LocksUnavailableError

LOADS = """
import fusetune.ekf2.compiled.compilation
from fusetune.ekf2.replay.loop import run_estimator
from fusetune.ekf2.replay.warm_up import compile_kernels
compile_kernels()
print(fusetune.__file__, len(run_estimator.stats.cache_hits), len(run_estimator.stats.cache_misses))
"""


@pytest.fixture(scope="module")
def kernels() -> Path:
    """The folder of the kernels of this processor, compiled."""
    if config.DISABLE_JIT:
        pytest.skip("Numba is switched off")
    compile_kernels()
    return compilation.kernel_folder()


@pytest.fixture
def cache(kernels: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the cache in use that takes its place; where it would be compiled, nothing is."""
    caches = Path(config.CACHE_DIR)
    copied = tmp_path / "cache"
    shutil.copytree(kernels, copied / kernels.relative_to(caches))
    monkeypatch.setattr(config, "CACHE_DIR", str(copied))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(copied))
    return copied / kernels.relative_to(caches)


@pytest.fixture
def compilations(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The commands by which the estimator would have been compiled; each leaves something that may be loaded."""
    commands: list[list[str]] = []

    def compiled(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        commands.append(command)
        monkeypatch.setattr(compilation, "_may_be_loaded", lambda _: True)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(compilation.subprocess, "run", compiled)
    ensure_compiled.cache_clear()
    return commands


def test_a_copy_of_the_checkout_with_other_times_loads_what_was_compiled(kernels: Path, tmp_path: Path) -> None:
    package, checkout = Path(fusetune.__file__).parent, tmp_path / "elsewhere"
    shutil.copytree(package, checkout / "src" / "fusetune", ignore=shutil.ignore_patterns("__pycache__"))
    for file in checkout.rglob("*.py"):
        os.utime(file, (2e9, 2e9))
    (checkout / "workflow").mkdir()
    (checkout / "workflow" / "Snakefile").touch()
    caches = Path(config.CACHE_DIR)
    place = checkout / ".cache" / "numba" / caches.name / kernels.relative_to(caches)
    shutil.copytree(kernels, place)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment["PYTHONPATH"] = str(checkout / "src")
    command = [sys.executable, "-c", LOADS]
    printed = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True, cwd=tmp_path)
    assert printed.stdout.split() == [str(checkout / "src" / "fusetune" / "__init__.py"), "1", "0"]


def test_what_is_as_it_was_compiled_is_not_compiled_again(cache: Path, compilations: list[list[str]]) -> None:
    ensure_compiled()
    assert compilations == []


@pytest.mark.parametrize("damage", ["flipped bit", "lost file", "lost record"])
def test_damaged_kernels_are_deleted_and_compiled(cache: Path, compilations: list[list[str]], damage: str) -> None:
    code = next(cache.glob("*.nbc"))
    if damage == "flipped bit":
        content = bytearray(code.read_bytes())
        content[len(content) // 2] ^= 1
        code.write_bytes(content)
    else:
        (code if damage == "lost file" else cache / compilation.RECORD_NAME).unlink()
    ensure_compiled()
    assert len(compilations) == 1
    assert list(cache.iterdir()) == []


def test_another_release_is_compiled_beside_what_is_there_when_it_is_first_asked_for(
    cache: Path, compilations: list[list[str]]
) -> None:
    (cache / compilation.RELEASES_NAME).write_text('["v1.16"]', encoding="utf-8")
    before = {file: file.read_bytes() for file in cache.iterdir()}
    ensure_compiled()
    assert compilations == []
    ensure_compiled("v1.17")
    assert [command[-2:] for command in compilations] == [["--release", "v1.17"]]
    assert {file: file.read_bytes() for file in cache.iterdir()} == before
    (cache / compilation.RELEASES_NAME).write_text('["v1.16", "v1.17"]', encoding="utf-8")
    ensure_compiled.cache_clear()
    ensure_compiled("v1.17")
    assert len(compilations) == 1


def test_kernels_of_another_processor_are_left_alone(
    cache: Path, compilations: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    other = cache.parents[2] / "another processor" / "ekf2" / "replay"
    monkeypatch.setattr(compilation, "kernel_folder", lambda: other)
    before = {file: file.read_bytes() for file in cache.iterdir()}
    ensure_compiled()
    assert len(compilations) == 1
    assert {file: file.read_bytes() for file in cache.iterdir()} == before


@pytest.mark.parametrize("place", [".", "..", "*.nbc"])
def test_kernels_that_others_could_have_written_are_deleted_and_compiled_out_of_their_reach(
    cache: Path, compilations: list[list[str]], place: str
) -> None:
    exposed = next(cache.glob(place)) if "*" in place else cache / place
    exposed.chmod(exposed.stat().st_mode | 0o002)
    ensure_compiled()
    assert len(compilations) == 1
    assert list(cache.iterdir()) == []
    assert not kernel_cache.others_may_write_kernels(cache)


def test_kernels_are_loaded_from_where_nothing_can_be_written(
    cache: Path, compilations: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    locator = KernelLocator.from_function(loop.run_estimator.py_func, loop.__file__)
    assert locator is not None
    assert Path(locator.get_cache_path()) == cache

    def refuse(**_: object) -> None:
        raise PermissionError("read-only file system")

    monkeypatch.setattr("numba.core.caching.tempfile.TemporaryFile", refuse)
    assert KernelLocator.from_function(loop.run_estimator.py_func, loop.__file__) is not None
    ensure_compiled()
    assert compilations == []


def test_a_cache_without_kernels_that_cannot_be_made_is_named(
    tmp_path: Path, compilations: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "file" / "cache"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", config.CACHE_DIR)
    with pytest.raises(UserError, match="does not hold the estimator for this processor"):
        ensure_compiled()
    assert compilations == []


def test_the_processor_is_part_of_the_place(kernels: Path) -> None:
    code = "from fusetune.ekf2.compiled import compilation; print(compilation.kernel_folder())"
    environment = os.environ | {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    run = subprocess.run([sys.executable, "-c", code], env=environment, check=True, stdout=subprocess.PIPE, text=True)
    other = Path(run.stdout.strip())
    assert other != kernels
    assert other.parents[2] == kernels.parents[2]


def test_where_the_file_system_has_no_locks_nobody_is_waited_for(
    tmp_path: Path, compilations: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> bool:
        raise LocksUnavailableError("no locks available")

    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", config.CACHE_DIR)
    monkeypatch.setattr(compilation, "lock", refuse)
    ensure_compiled()
    assert compilations


def test_what_cannot_be_compiled_in_one_piece_is_compiled_the_usual_way(
    cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    commands: list[list[str]] = []

    def started(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        commands.append(command[3:])
        return subprocess.CompletedProcess(command, 1)

    monkeypatch.setattr(compilation.subprocess, "run", started)
    (cache / compilation.RECORD_NAME).unlink()
    ensure_compiled.cache_clear()
    ensure_compiled()
    assert commands == [[], [compilation.PLAIN]]
    assert f"Numba {numba.__version__} does not compile the estimator in one piece" in capsys.readouterr().err


PARTS = """
import sys, hashlib
import numpy as np
from contextlib import nullcontext
from fusetune.ekf2.compiled.compilation import PLAIN, joined_without_optimising
from fusetune.ekf2.compiled.kernel import entry_kernel
from fusetune.ekf2.filter.common.core_memory import CORE_MEMORY
from fusetune.ekf2.filter.prediction import predict_covariance, predict_state
from fusetune.ekf2.filter.common.parameters import complete, parameter_record

@entry_kernel
def entry(ekf, params, steps):
    for step in range(steps):
        imu = ekf.imu_delayed
        for axis in range(3):
            imu.delta_ang[axis] = 0.001 * (axis + 1) * np.sin(0.1 * step)
            imu.delta_vel[axis] = 0.02 * np.cos(0.07 * step + axis)
            ekf.P[3 + axis, 3 + axis] += 1e-3
        imu.delta_ang_dt = 0.01
        imu.delta_vel_dt = 0.01
        predict_covariance(ekf, params)
        predict_state(ekf, params)

ekf, params = np.zeros(1, CORE_MEMORY), parameter_record(complete({}, {}, None))
ekf["P"][0], ekf["R_to_earth"][0], ekf["q"][0, 0], ekf["dt_ekf_avg"] = np.eye(24) * 1e-3, np.eye(3), 1.0, 0.01
with nullcontext() if PLAIN in sys.argv else joined_without_optimising():
    entry(ekf[0], params[0], 500)
assert np.isfinite(ekf["P"]).all() and ekf["P"].any()
print(hashlib.sha256(ekf.tobytes()).hexdigest(), len(entry.stats.cache_hits))
"""


def test_in_one_piece_from_the_cache_and_the_usual_way_the_same_bits_are_computed(tmp_path: Path) -> None:
    if config.DISABLE_JIT:
        pytest.skip("Numba is switched off")
    environment = os.environ | {compilation.CHILD_MARK: "1"}
    (tmp_path / "parts.py").write_text(PARTS, encoding="utf-8")
    compiled, loaded, plain = (
        subprocess.run(
            [sys.executable, str(tmp_path / "parts.py"), *options],
            env=environment | {"NUMBA_CACHE_DIR": str(tmp_path / f"cache{len(options)}")},
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        ).stdout.split()
        for options in ([], [], [compilation.PLAIN])
    )
    assert compiled[0] == loaded[0] == plain[0]
    assert [hits for _, hits in (compiled, loaded, plain)] == ["0", "1", "0"]
