"""Another workflow takes this one as a module, from GitHub as from a path, under other names and below a prefix."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.workflow.conftest import ROOT, Workspace

# As snakedeploy writes it, and a prefix besides.
SNAKEFILE = """
configfile: "config/config.yaml"

module fusetune:
    snakefile: {snakefile}
    config: config
    prefix: "tuned"

use rule * from fusetune as fusetune_*

rule ours:
    default_target: True
    input: "tuned/results/analyze/first/scoring.json"
    output: "ours.txt"
    shell: "cp {{input}} {{output}}"
"""
GITHUB = 'github("example/fusetune", path="workflow/Snakefile", branch="main")'


def snakemake(workspace: Workspace, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "snakemake", "--cores", "2", *arguments]
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")} | variables
    return subprocess.run(command, cwd=workspace.folder, env=environment, capture_output=True, text=True, check=False)


def test_a_module_from_github_works_below_its_prefix_and_only_there(flown: Workspace, tmp_path: Path) -> None:
    """Snakemake keeps the files of such a workflow one by one; git is told to find the repository on this disk."""
    repository = tmp_path / "repository"
    for name in ("workflow", "config"):
        shutil.copytree(ROOT / name, repository / name, ignore=shutil.ignore_patterns("__pycache__"))
    who = ["-c", "user.name=fusetune", "-c", "user.email=fusetune@example.org"]
    for command in (["init", "--quiet", "--initial-branch=main"], ["add", "."], ["commit", "--quiet", "-m", "all"]):
        subprocess.run(["git", *who, *command], cwd=repository, check=True)
    instead = {"GIT_CONFIG_COUNT": "1", "GIT_CONFIG_KEY_0": f"url.{repository}.insteadOf"}
    instead |= {"GIT_CONFIG_VALUE_0": "https://github.com/example/fusetune", "XDG_CACHE_HOME": str(tmp_path / "cache")}
    (flown.folder / "Snakefile").write_text(SNAKEFILE.format(snakefile=GITHUB), encoding="utf-8")
    before = {*os.listdir(flown.folder)}
    done = snakemake(flown, **instead)
    assert done.returncode == 0, done.stdout + done.stderr
    made = {*os.listdir(flown.folder)} - before - {".snakemake", ".cache"}
    assert made == {"tuned", "ours.txt"}
    assert {*os.listdir(flown.folder / "tuned")} == {"results"}
    refused = (flown.folder / "tuned" / "results" / "save" / "flights.csv").read_text(encoding="utf-8")
    assert "broken" in refused
    assert (flown.folder / "tuned" / "results" / "benchmarks" / "analyze" / "first.tsv").is_file()

    # the same rules from a path
    path = repr(str(ROOT / "workflow" / "Snakefile"))
    (flown.folder / "Snakefile").write_text(SNAKEFILE.format(snakefile=path), encoding="utf-8")
    planned = snakemake(flown, "--dry-run", "fusetune_all")
    assert "fusetune_decide" in planned.stdout, planned.stderr


def test_what_is_wrong_in_a_modules_configuration_is_told_by_its_name(workspace: Workspace) -> None:
    path = repr(str(ROOT / "workflow" / "Snakefile"))
    snakefile = SNAKEFILE.format(snakefile=path).replace("config: config", 'config: {"studdy": "mine.yaml"}')
    (workspace.folder / "Snakefile").write_text(snakefile, encoding="utf-8")
    told = snakemake(workspace, "--dry-run").stdout
    assert "config of the module fusetune: unknown key 'studdy' (did you mean 'study'?)" in told
