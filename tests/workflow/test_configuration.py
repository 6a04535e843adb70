"""Schema, shipped configuration, its manual and the locked versions say the same."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml


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
    from fusetune.analyze.settings import ScoringSettings
    from fusetune.analyze.trust_settings import TrustSettings
    from fusetune.analyze.withheld_gaps import WithholdingSettings
    from fusetune.apply.settings import DecisionSettings
    from fusetune.px4.reading_limits import ReadingLimits
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
    from fusetune.analyze.sources import AID_SOURCES
    from fusetune.ekf2.withholding import WITHHOLDABLE

    decision = schema["properties"]["decision"]["properties"]
    assert decision["sources"]["propertyNames"]["enum"] == sorted(AID_SOURCES)
    pattern = re.compile(decision["withheld_sources"]["propertyNames"]["pattern"])
    for source in (source for sources in WITHHOLDABLE.values() for source in sources):
        axes = "xyz"[: AID_SOURCES[source].axes]
        assert pattern.match(source)
        assert [axis for axis in "xyz" if pattern.match(f"{source}.{axis}")] == list(axes)


def test_the_conda_environment_has_the_locked_versions(project_root: Path) -> None:
    locked = set((project_root / "requirements.lock").read_text(encoding="utf-8").lower().split())
    environment = yaml.safe_load((project_root / "workflow" / "envs" / "fusetune.yaml").read_text(encoding="utf-8"))
    pinned = environment["dependencies"][-1]["pip"]
    assert pinned
    assert set(pinned) <= locked
