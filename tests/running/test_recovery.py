from __future__ import annotations

import base64
from pathlib import Path

import pytest

from fusetune.running.recovery import (
    belong_together,
    bind_together,
    remove_stale_locks,
    remove_unfinished,
    unfinished_files,
)
from fusetune.running.run_lock import Claim, Holder


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def mark(state: Path, file: str) -> Path:
    """Mark a file as Snakemake does: its name in URL-safe base 64, cut after 254 characters into folders."""
    text = base64.urlsafe_b64encode(file.encode()).decode()
    cuts = [text[first : first + 254] for first in range(0, len(text), 254)]
    marker = state.joinpath("incomplete", *(f"@{cut}" for cut in cuts[:-1]), cuts[-1])
    marker.parent.mkdir(parents=True, exist_ok=True)
    marker.write_text('{"external_jobid": null}', encoding="ascii")
    return marker


def test_unfinished_files_of_this_workflow_go_and_those_of_others_stay(place: Path) -> None:
    state, results = Path(".snakemake"), Path("results")
    long_name = f"results/save/{'x' * 240}"
    for folder in ("results/save/folder", long_name):
        Path(folder).mkdir(parents=True)
        (Path(folder) / "part").write_bytes(b"half")
    kernels = place / "cache" / "ready.json"
    kernels.parent.mkdir()
    for file in (Path("results/half"), Path("results/whole"), Path("other"), Path("resultsandmore"), kernels):
        file.write_bytes(b"")
    own = [
        mark(state, str(file)) for file in ("results/save/folder", long_name, "results/half", "results/gone", kernels)
    ]
    strange = [mark(state, "other"), mark(state, "resultsandmore"), mark(state, "results/../other")]
    (state / "incomplete" / "no base 64").write_bytes(b"")

    remove_unfinished(unfinished_files(state, [results, kernels]))
    assert sorted(str(path) for path in results.rglob("*")) == ["results/save", "results/whole"]
    assert not kernels.exists()
    assert not any(marker.exists() for marker in own)
    assert all(marker.exists() for marker in strange)
    assert Path("other").exists()
    assert list(unfinished_files(state, [results, kernels])) == []


def test_a_link_among_unfinished_files_goes_and_what_it_leads_to_stays(place: Path) -> None:
    (place / "kept").mkdir()
    (place / "results").mkdir()
    (place / "results" / "save").symlink_to(place / "kept")
    mark(Path(".snakemake"), "results/save")
    remove_unfinished(unfinished_files(Path(".snakemake"), [Path("results")]))
    assert (place / "kept").is_dir()
    assert not (place / "results" / "save").is_symlink()


def test_locks_go_only_after_a_run_that_never_ended(tmp_path: Path) -> None:
    lock = tmp_path / "locks" / "0.output.lock"
    lock.parent.mkdir()
    lock.write_text("results/report.html\n", encoding="ascii")
    for claim in (Claim(locked=True, former=None), Claim(locked=False, former=None)):
        remove_stale_locks(tmp_path, claim)
        assert lock.exists()
    remove_stale_locks(tmp_path, Claim(locked=True, former=Holder.here("killed")))
    assert not lock.exists()


def test_results_belong_to_the_memory_they_were_made_under(tmp_path: Path) -> None:
    state, results = tmp_path / ".snakemake", tmp_path / "results"
    assert not belong_together(state, results)
    bind_together(state, results)
    assert belong_together(state, results)
    other_state, other_results = tmp_path / "a" / ".snakemake", tmp_path / "a" / "results"
    bind_together(other_state, other_results)
    assert not belong_together(state, other_results)
    assert not belong_together(other_state, results)
    assert not belong_together(tmp_path / "lost", results)
    assert not belong_together(state, tmp_path / "lost")
