"""The configuration, what is made of it, what is said of mistakes in it; and the locked versions say the same."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from dataclasses import MISSING
from importlib.metadata import requires
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml
from packaging.requirements import Requirement
from tests.made_text import UpToDate
from tests.settings.configuration_texts import (
    configuration_text,
    faults_text,
    leaves,
    manual_text,
    schema_text,
    shapes_text,
)

from fusetune.analyze.replaying.settings import IN_USE
from fusetune.configuration import Configuration, read_configuration
from fusetune.design.missions.mission import Mission
from fusetune.errors import UserError
from fusetune.execute.vehicle import Vehicle
from fusetune.save.thresholds import VerdictThresholds
from fusetune.settings.checking import checked


def test_schema_file_and_manual_say_what_is_declared(project_root: Path, up_to_date: UpToDate) -> None:
    up_to_date(project_root / "workflow" / "schemas" / "config.schema.yaml", None, schema_text())
    up_to_date(project_root / "config" / "config.yaml", None, configuration_text())
    manual = project_root / "config" / "README.md"
    up_to_date(manual, "settings", f"\n{manual_text(Configuration)}\n\n")
    up_to_date(manual, "mission", f"\n{manual_text(Mission)}\n\n")
    up_to_date(manual, "shapes", f"\n{shapes_text()}\n\n")
    up_to_date(manual, "vehicle", f"\n{manual_text(Vehicle)}\n\n")
    up_to_date(manual, "faults", f"\n{faults_text()}\n\n")


def test_the_schema_is_a_schema(project_root: Path) -> None:
    schema = yaml.safe_load((project_root / "workflow" / "schemas" / "config.schema.yaml").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)


def test_the_shipped_configuration_is_the_default(project_root: Path) -> None:
    """`IN_USE`, the thresholds and so on are what a caller of the package gets who says nothing."""
    shipped = read_configuration([project_root / "config" / "config.yaml"])
    assert shipped == Configuration()
    assert shipped.replay == IN_USE
    assert yaml.safe_load((project_root / "config" / "config.yaml").read_text(encoding="utf-8"))["seed"] == shipped.seed


def test_every_setting_has_a_meaning_and_a_default_that_may_be_given(tmp_path: Path) -> None:
    for place, one in leaves(Configuration):
        assert one.meaning, place
        assert one.default is not MISSING, place
        *sections, key = place.split(".")
        document: dict[str, Any] = {key: list(one.default) if isinstance(one.default, tuple) else one.default}
        for name in reversed(sections):
            document = {name: document}
        assert checked(Configuration, document, "config.yaml") == Configuration()


def test_all_files_and_the_command_line_make_one_configuration(tmp_path: Path) -> None:
    first, second = tmp_path / "first.yaml", tmp_path / "second.yaml"
    first.write_text("seed: 3\nscoring: {settle_s: 2, block_s: 4.0}\ndecision: {sources: {mag: 2}}\n", encoding="utf-8")
    second.write_text("scoring: {settle_s: 1e1}\n", encoding="utf-8")
    settings = read_configuration([first, second], {"decision": {"sources": {"mag": 0.5, "baro_hgt": 1}}})
    assert settings.seed == 3
    assert (settings.scoring.settle_s, settings.scoring.block_s, settings.scoring.window_s) == (10.0, 4.0, 30.0)
    assert settings.decision.sources == {"mag": 0.5, "baro_hgt": 1.0}
    assert settings.verdict == VerdictThresholds()


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        ({"verdict": {"low_imu": 3}}, ("verdict: unknown key 'low_imu'", "did you mean 'low_imu_rate_hz'?")),
        (
            {"verdict": {"low_imu_rate_hz": "fast"}},
            ("verdict.low_imu_rate_hz is 'fast'; expected a number between 1 and 1000", "warning [Hz]"),
        ),
        ({"reading": {"max_tables": -1}}, ("reading.max_tables is -1; expected a whole number between 50 and 100000",)),
        ({"reading": {"max_columns": True}}, ("reading.max_columns is true; expected a whole number",)),
        ({"start": {"mode": "lukewarm"}}, ("start.mode is 'lukewarm'; expected one of 'auto', 'warm', 'cold'",)),
        ({"withheld": {"gnss_s": -1.0}}, ("withheld.gnss_s is -1.0; expected a number between 0 and 60",)),
        ({"reconstruction": {"imu": 1}}, ("reconstruction.imu is 1; expected true or false",)),
        ({"trust": {"heading_deg": [4, 2, 10]}}, ("trust.heading_deg is [4.0, 2.0, 10.0]; expected three rising",)),
        ({"trust": {"flags_equal": [0.7, 0.8, 0.9]}}, ("trust.flags_equal is", "three falling numbers")),
        ({"trust": {"heading_deg": [4, 5]}}, ("trust.heading_deg is a list of 2; expected a list of length 3 –",)),
        ({"trust": {"needed_for_b": ["speed"]}}, ("trust.needed_for_b[0] is 'speed'; expected one of", "'height_m'")),
        ({"decision": {"sources": {"sonar": 1.0}}}, ("decision.sources: the key 'sonar'", "'gnss_vel'")),
        ({"decision": {"sources": {}}}, ("decision.sources is an empty mapping", "of size at least 1")),
        ({"decision": {"sources": {"gnss_vel": -1}}}, ("decision.sources.gnss_vel is -1; expected a number between",)),
        ({"decision": {"withheld_sources": {"gnss_pos.z": 1}}}, ("the key 'gnss_pos.z'", "'gnss_pos.y'")),
        ({"decision": {"lowest_grade": "E"}}, ("decision.lowest_grade is 'E'; expected one of 'A', 'B', 'C', 'D'",)),
        ({"decision": {"seed": 2}}, ("decision: unknown key 'seed'",)),
        (
            {"demonstration": {"faults": {"flight_1": {}}}},
            ("demonstration.faults.flight_1 is an empty mapping; expected a list",),
        ),
    ],
)
def test_what_cannot_be_meant_is_told_with_file_key_and_expectation(
    given: dict[str, Any], parts: tuple[str, ...]
) -> None:
    with pytest.raises(UserError) as error:
        checked(Configuration, given, "config/config.yaml")
    assert str(error.value).startswith("config/config.yaml: ")
    assert "config/README.md" in error.value.remedy
    for part in parts:
        assert part in str(error.value)


def test_the_configuration_is_read_without_the_numerics() -> None:
    """The workflow reads it whenever it starts; so does a job that has only values to take over."""
    for module, absent in (
        ("fusetune.inputs", {"numpy", "numba", "pyarrow", "scipy", "pydantic"}),
        ("fusetune.save.thresholds", {"jsonschema", "yaml", "pydantic"}),
    ):
        loaded = f"import sys, {module}; print(sorted({absent!r} & set(sys.modules)))"
        assert subprocess.check_output([sys.executable, "-c", loaded], text=True) == "[]\n", module


LOCK_FILES = {
    "requirements-dev.lock": ("build", "test", "dev"),
    "requirements.lock": ("build",),
    "requirements-upload.lock": ("upload",),
    "requirements-slurm.lock": ("slurm",),
    "requirements-mlflow.lock": ("mlflow",),
}


def locked(file: Path) -> dict[str, tuple[str, list[str]]]:
    """Name of each package of a lock file -> version and hashes; anything else in the file fails."""
    entries = re.split(r"(?<!\\)\n", file.read_text(encoding="utf-8").strip())
    found = {}
    for entry in entries:
        match = re.fullmatch(r"([\w.-]+)==([\w.]+)(?: ; [^\\/]+?)?((?: \\\n    --hash=sha256:[0-9a-f]{64})+)", entry)
        assert match, entry[:200]
        name, version, hashes = match.groups()
        found[name.lower().replace("_", "-")] = version, re.findall(r"[0-9a-f]{64}", hashes)
    assert len(found) == len(entries)
    return found


@pytest.mark.parametrize("name", LOCK_FILES)
def test_a_lock_file_pins_all_that_the_project_asks_for(project_root: Path, name: str) -> None:
    pins = locked(project_root / name)
    project = tomllib.loads((project_root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = [Requirement(text) for text in project["dependencies"]]
    asked += [Requirement(text) for extra in LOCK_FILES[name] for text in project["optional-dependencies"][extra]]
    for requirement in asked:
        version, hashes = pins[requirement.name.lower()]
        assert version in requirement.specifier, requirement
        assert len(set(hashes)) == len(hashes) >= 1


def test_the_lock_files_agree(project_root: Path) -> None:
    pins, *others = (locked(project_root / name) for name in LOCK_FILES)
    for beside in others:
        assert {name for name in pins.keys() & beside.keys() if pins[name] != beside[name]} == set()
    alone = others[0].keys()
    assert alone < pins.keys(), "the pipeline's packages are among those of development"
    assert not alone & {"mypy", "pymavlink", "pytest", "ruff"}, "what the pipeline runs with, no more"


CONDA_PYTHON = "3.11"
CONDA_ENVIRONMENT = """\
# For `snakemake --sdm conda`: all that jobs import, in the versions of requirements.lock; the package itself comes from
# where the workflow found it. Made from requirements.lock, renewed by pytest --update.
channels:
  - conda-forge
  - nodefaults
dependencies:
  - python={python}
  - pip
  - pip:
{pins}
"""
OF_CONDA = {
    "python_version": CONDA_PYTHON,
    "python_full_version": f"{CONDA_PYTHON}.0",
    "implementation_name": "cpython",
    "platform_python_implementation": "CPython",
    "os_name": "posix",
    "sys_platform": "linux",
    "platform_system": "Linux",
    "extra": "",
}


OUTSIDE_OF_JOBS = {"argcomplete", "rich", "snakemake", "snakemake-interface-logger-plugins"}
"""What runs jobs, or tells of them."""


def asked_by_jobs(project_root: Path) -> set[str]:
    """Names of the packages that jobs import, and of those that these ask for."""
    project = tomllib.loads((project_root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = [Requirement(text).name for text in project["dependencies"]]
    found: set[str] = set()
    while asked:
        name = asked.pop().lower().replace("_", "-")
        if name not in found | OUTSIDE_OF_JOBS:
            found.add(name)
            needed = map(Requirement, requires(name) or ())
            asked += [one.name for one in needed if one.marker is None or one.marker.evaluate(OF_CONDA)]
    return found


def test_the_conda_environment_has_the_locked_versions_of_all_that_jobs_import(
    project_root: Path, up_to_date: UpToDate
) -> None:
    pins = locked(project_root / "requirements.lock")
    lines = [f"      - {name}=={pins[name][0]}" for name in sorted(asked_by_jobs(project_root))]
    text = CONDA_ENVIRONMENT.format(python=CONDA_PYTHON, pins="\n".join(lines))
    up_to_date(project_root / "workflow" / "envs" / "fusetune.yaml", None, text)
