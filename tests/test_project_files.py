"""What the project says of itself, and does at each change, in several files is the same in all."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

import fusetune
from fusetune.ekf2.compiled.kernel_cache import kernel_cache
from fusetune.ekf2.compiled.kernel_locator import target_name

CHECKS = ["lint", "types", "test", "demonstration", "docs", "browser"]


@pytest.fixture(scope="module")
def project(project_root: Path) -> dict[str, Any]:
    return tomllib.loads((project_root / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def document(file: Path) -> Any:
    """A YAML file with all values as texts: YAML takes `on` for true and 3.10 for 3.1."""
    return yaml.load(file.read_text(encoding="utf-8"), yaml.BaseLoader)


@pytest.fixture(scope="module")
def jobs(project_root: Path) -> dict[str, Any]:
    return document(project_root / ".github" / "workflows" / "checks.yml")["jobs"]


def commands(job: dict[str, Any]) -> list[str]:
    return [step["run"].strip() for step in job["steps"] if "run" in step]


def test_citation_changelog_and_package_name_the_same_release(project_root: Path, project: dict[str, Any]) -> None:
    citation = document(project_root / "CITATION.cff")
    assert citation["cff-version"] == "1.2.0"
    assert citation["version"] == fusetune.__version__
    assert citation["authors"] == project["authors"]
    assert citation["license"] == project["license"]
    assert citation["keywords"] == project["keywords"]
    headings = re.findall(r"^## .*$", (project_root / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert headings[:2] == ["## [Unreleased]", f"## [{fusetune.__version__}] - {citation['date-released']}"]


def test_the_tests_run_on_every_python_and_system_that_the_package_names(
    jobs: dict[str, Any], project: dict[str, Any]
) -> None:
    matrix = jobs["tests"]["strategy"]["matrix"]
    named = re.findall(r"Python :: (3\.\d+)", "\n".join(project["classifiers"]))
    assert matrix["python-version"] == named
    assert project["requires-python"] == f">={named[0]}"
    systems = {system.partition("-")[0] for system in matrix["os"]}
    assert systems == {"ubuntu", "macos"}
    assert {"Operating System :: POSIX :: Linux", "Operating System :: MacOS"} <= set(project["classifiers"])


def test_github_and_ci_call_the_checks_of_the_makefile_and_have_none_of_their_own(
    project_root: Path, jobs: dict[str, Any]
) -> None:
    on_github = []
    for job in jobs.values():
        checks = job.get("strategy", {}).get("matrix", {}).get("check", [""])
        on_github += [command.replace("${{ matrix.check }}", check) for command in commands(job) for check in checks]
    assert sorted(on_github) == sorted(f"make {check}" for check in CHECKS)
    here = re.findall(r"^(make \w+)$", (project_root / ".ci" / "run").read_text(encoding="utf-8"), re.MULTILINE)
    assert here == [
        "make setup",
        "make lint",
        "make types",
        "make demonstration",
        "make docs",
        "make browser",
        "make test",
    ]
    made = subprocess.run(
        ["make", "--dry-run", "--always-make", *CHECKS], cwd=project_root, check=True, capture_output=True, text=True
    ).stdout
    for tool in (
        "ruff check",
        "ruff format --check",
        "snakefmt --check",
        "snakemake --lint",
        "lint-imports",
        "mypy",
        "pytest",
    ):
        assert f".venv/bin/{tool}" in made


def test_what_others_wrote_is_pinned_to_commits(project_root: Path) -> None:
    texts = [file.read_text(encoding="utf-8") for file in (project_root / ".github").rglob("*.yml")]
    uses = [use for text in texts for use in re.findall(r"uses: (.*)", text) if not use.startswith("./")]
    assert len(uses) >= 4
    assert [use for use in uses if not re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", use)] == []
    assert len({use.partition("@")[0] for use in uses}) == len(set(uses)), "one action in two versions"
    hooks = document(project_root / ".pre-commit-config.yaml")["repos"]
    assert [repo for repo in hooks if repo["repo"] != "local" and not re.fullmatch(r"[0-9a-f]{40}", repo["rev"])] == []


def test_hooks_take_the_tools_that_are_locked_from_the_environment(project_root: Path) -> None:
    """So there is no second version of them to agree with."""
    locked = set(
        re.findall(r"^([\w.-]+)==", (project_root / "requirements-dev.lock").read_text(encoding="utf-8"), re.MULTILINE)
    )
    config = document(project_root / ".pre-commit-config.yaml")
    for repo in config["repos"]:
        for hook in repo["hooks"]:
            if repo["repo"] == "local":
                assert hook["entry"].startswith(".venv/bin/"), hook["id"]
                assert hook["language"] == "system", hook["id"]
            else:
                assert not locked & {hook["id"], repo["repo"].rpartition("/")[2]}
            assert "additional_dependencies" not in hook


def test_on_github_compiled_kernels_are_kept_by_sources_and_processor(project_root: Path, tmp_path: Path) -> None:
    steps = document(project_root / ".github" / "actions" / "set-up" / "action.yml")["runs"]["steps"]
    step = next(step for step in steps if step.get("id") == "kernels")
    output = tmp_path / "output"
    subprocess.run(
        ["bash", "-euo", "pipefail", "-c", step["run"].replace(".venv/bin/python", sys.executable)],
        env=os.environ | {"GITHUB_OUTPUT": str(output)},
        check=True,
        cwd=project_root,
    )
    said = [f"folder={kernel_cache()}", f"key={kernel_cache().name}-{target_name()}"]
    assert output.read_text(encoding="utf-8").splitlines() == said
    kept = next(step for step in steps if step.get("uses", "").startswith("actions/cache@"))["with"]
    assert kept["path"] == "${{ steps.kernels.outputs.folder }}"
    assert kept["key"].endswith("${{ steps.kernels.outputs.key }}")
