"""Workflow and configuration are found in a checkout and in an installed package, the user's own files first."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusetune.configuration import read_configuration
from fusetune.running import workflow_files
from fusetune.running.workflow_files import file_or_packaged, packaged_config, pipeline_folder, workflow_file

STUDY = "config/studies/around_present.yaml"


def test_a_checkout_has_them_at_its_top(project_root: Path) -> None:
    assert pipeline_folder() == project_root
    assert workflow_file() == project_root / "workflow" / "Snakefile"
    assert packaged_config() == project_root / "config"


def test_an_installed_package_has_them_within_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where somebody's project, of the same layout, is what it is installed into."""
    installed = tmp_path / "lib" / "fusetune"
    (tmp_path / "workflow").mkdir()
    (tmp_path / "workflow" / "Snakefile").touch()
    monkeypatch.setattr(workflow_files, "PACKAGE", installed)
    assert workflow_file() == installed / "packaged" / "workflow" / "Snakefile"


def test_files_of_the_folder_come_before_those_of_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert file_or_packaged(STUDY) == str(packaged_config() / "studies" / "around_present.yaml")
    # what is in neither, and what a configuration of the package never means, stays to be told of
    for name in ("config/studies/mine.yaml", "workflow/Snakefile", "config/../pyproject.toml"):
        assert file_or_packaged(name) == name
    (tmp_path / "config" / "studies").mkdir(parents=True)
    (tmp_path / STUDY).touch()
    assert file_or_packaged(STUDY) == STUDY
    settings = read_configuration([packaged_config() / "config.yaml"], {"missions_dir": "config/missions"})
    assert settings.study == STUDY
    from_the_package = [settings.mission, settings.missions_dir, settings.demonstration.study]
    from_the_package += [settings.demonstration.vehicle, *settings.covariance_designs]
    assert [name for name in from_the_package if not Path(str(name)).is_relative_to(packaged_config())] == []
