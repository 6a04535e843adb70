"""A folder of one's own for the pipeline."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusetune.configuration import read_configuration
from fusetune.errors import UserError
from fusetune.running.project_folder import link_results, make_project_folder


def test_a_new_folder_has_all_settings_a_place_for_logs_and_a_word_on_both(tmp_path: Path, project_root: Path) -> None:
    folder = make_project_folder(tmp_path / "new" / "tuning")
    assert sorted(one.name for one in folder.iterdir()) == ["README.md", "config", "flights"]
    own, ours = folder / "config", project_root / "config"
    assert read_configuration([own / "config.yaml"]) == read_configuration([ours / "config.yaml"])
    files = {str(one.relative_to(ours)) for one in ours.rglob("*") if one.is_file()}
    assert {str(one.relative_to(own)) for one in own.rglob("*") if one.is_file()} == files
    # what leads out of the folder leads nowhere
    for name in ("config.yaml", "README.md"):
        assert "](../" not in (own / name).read_text(encoding="utf-8")
    assert "workflow/schemas" not in (own / "config.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize("there", ["config/config.yaml", "README.md", "flights/one.ulg"])
def test_nothing_is_written_over(there: str, tmp_path: Path) -> None:
    (tmp_path / there).parent.mkdir(exist_ok=True)
    (tmp_path / there).write_text("dear")
    with pytest.raises(UserError, match="is there already"):
        make_project_folder(tmp_path)
    assert (tmp_path / there).read_text() == "dear"
    assert len([one for one in tmp_path.rglob("*") if one.is_file()]) == 1


def test_results_may_lie_elsewhere_but_not_over_others(tmp_path: Path) -> None:
    (tmp_path / "work").mkdir()
    for _ in range(2):
        link_results(tmp_path / "work", tmp_path / "large" / "disk")
    assert (tmp_path / "work" / "results").resolve() == (tmp_path / "large" / "disk").resolve()
    with pytest.raises(UserError, match="is there already"):
        link_results(tmp_path / "work", tmp_path / "other")
