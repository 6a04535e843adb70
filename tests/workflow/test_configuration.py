"""Schema, shipped configuration, its manual and the locked versions say the same."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml
from packaging.requirements import Requirement


@pytest.fixture
def schema(project_root: Path) -> dict[str, Any]:
    return yaml.safe_load((project_root / "workflow" / "schemas" / "config.schema.yaml").read_text(encoding="utf-8"))


@pytest.fixture
def shipped(project_root: Path) -> dict[str, Any]:
    return yaml.safe_load((project_root / "config" / "config.yaml").read_text(encoding="utf-8"))


def leaves(schema: dict[str, Any], place: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    for key, part in schema.get("properties", {}).items():
        if part.get("properties"):
            yield from leaves(part, f"{place}{key}.")
        else:
            yield f"{place}{key}", part


def value_at(document: dict[str, Any], place: str) -> Any:
    for key in place.split("."):
        document = document[key]
    return document


def test_the_schema_is_a_schema(schema: dict[str, Any]) -> None:
    jsonschema.Draft202012Validator.check_schema(schema)


def test_the_shipped_configuration_is_valid_and_states_every_default(
    schema: dict[str, Any], shipped: dict[str, Any]
) -> None:
    jsonschema.validate(shipped, schema)
    for place, part in leaves(schema):
        assert value_at(shipped, place) == part["default"], place


def test_every_key_is_described_and_in_the_manual(schema: dict[str, Any], project_root: Path) -> None:
    manual = (project_root / "config" / "README.md").read_text(encoding="utf-8")
    for place, part in leaves(schema):
        assert part["description"], place
        assert f"`{place}`" in manual, f"config/README.md does not explain {place}"


def test_the_defaults_are_those_of_the_rooms(shipped: dict[str, Any]) -> None:
    from fusetune.analyze.replaying.withheld_gaps import WithholdingSettings
    from fusetune.analyze.scoring.scoring_settings import ScoringSettings
    from fusetune.analyze.trust.trust_settings import TrustSettings
    from fusetune.apply.settings import DecisionSettings
    from fusetune.px4.ulog.reading_limits import ReadingLimits
    from fusetune.save import VerdictThresholds

    assert ReadingLimits.from_mapping(shipped["reading"]) == ReadingLimits()
    assert shipped["reading"].keys() == asdict(ReadingLimits()).keys()
    assert ScoringSettings.from_mapping(shipped["scoring"]) == ScoringSettings()
    assert TrustSettings.from_mapping(shipped["trust"]) == TrustSettings()
    assert DecisionSettings.from_mapping(shipped["decision"], seed=0) == DecisionSettings()
    assert VerdictThresholds.from_mapping(shipped["verdict"]) == VerdictThresholds()
    assert shipped["verdict"].keys() == asdict(VerdictThresholds()).keys()
    assert WithholdingSettings.from_mapping(shipped["withheld"]) == WithholdingSettings()


def test_the_sources_that_may_rank_the_sets_are_those_that_are_scored(schema: dict[str, Any]) -> None:
    from fusetune.px4.aid_sources import MEASURED_SOURCES, WITHHOLDABLE

    decision = schema["properties"]["decision"]["properties"]
    assert decision["sources"]["propertyNames"]["enum"] == sorted(MEASURED_SOURCES)
    pattern = re.compile(decision["withheld_sources"]["propertyNames"]["pattern"])
    for source in (source for sources in WITHHOLDABLE.values() for source in sources):
        axes = "xyz"[: MEASURED_SOURCES[source].axes]
        assert pattern.match(source)
        assert [axis for axis in "xyz" if pattern.match(f"{source}.{axis}")] == list(axes)


LOCK_FILES = {"requirements.lock": ("test", "dev"), "requirements-slurm.lock": ("slurm",)}


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
    pins, beside = (locked(project_root / name) for name in LOCK_FILES)
    assert {name for name in pins.keys() & beside.keys() if pins[name] != beside[name]} == set()


def test_the_conda_environment_has_the_locked_versions(project_root: Path) -> None:
    pins = locked(project_root / "requirements.lock")
    environment = yaml.safe_load((project_root / "workflow" / "envs" / "fusetune.yaml").read_text(encoding="utf-8"))
    pinned = environment["dependencies"][-1]["pip"]
    assert pinned
    assert set(pinned) <= {f"{name}=={version}" for name, (version, _) in pins.items()}
