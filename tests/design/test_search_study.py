"""Studies that are a search: what their file may say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from fusetune.design.search_settings import SEARCHED, SearchSettings
from fusetune.design.study import load_study
from fusetune.design.tunable_parameters import TUNABLE_PARAMETERS
from fusetune.errors import UserError


def study_file(folder: Path, search: dict[str, Any]) -> Path:
    path = folder / "study.yaml"
    path.write_text(yaml.safe_dump({"name": "mine", "kind": "search", "search": search}), encoding="utf-8")
    return path


def test_the_example_is_a_search_with_the_defaults(project_root: Path) -> None:
    study = load_study(project_root / "config" / "studies" / "search.yaml")
    assert study.search == SearchSettings()
    assert study.sets == ()
    assert study.needs_flights


def test_its_section_is_read_as_declared(tmp_path: Path) -> None:
    given = {"parameters": ["EKF2_ACC_NOISE"], "bounds": {"EKF2_ACC_NOISE": [0.1, 1]}, "evaluations": 50, "seed": 7}
    search = load_study(study_file(tmp_path, given)).search
    assert search == SearchSettings(("EKF2_ACC_NOISE",), {"EKF2_ACC_NOISE": (0.1, 1.0)}, evaluations=50, seed=7)
    # the limit of PX4's buffers goes along with a longer delay
    assert search.varied == ("EKF2_ACC_NOISE", "EKF2_DELAY_MAX")


def test_what_is_searched_by_default_can_be_tuned() -> None:
    assert set(SEARCHED) <= TUNABLE_PARAMETERS.keys()


@pytest.mark.parametrize(
    ("search", "told"),
    [
        ({"parameters": ["EKF2_NO_SUCH"]}, "search.parameters: EKF2_NO_SUCH"),
        ({"parameters": ["EKF2_GPS_CTRL"]}, "EKF2_GPS_CTRL is none of those that are tuned"),
        ({"parameters": ["EKF2_ACC_NOISE"], "bounds": {"EKF2_GYR_NOISE": [0.01, 0.02]}}, "is not searched"),
        ({"bounds": {"EKF2_ACC_NOISE": [0.5, 0.1]}}, "expected the lowest value and the highest"),
        ({"bounds": {"EKF2_ACC_NOISE": [0.5]}}, "expected the lowest value and the highest"),
        ({"bounds": {"EKF2_ACC_NOISE": [0.5, 99]}}, "search.bounds.EKF2_ACC_NOISE"),
        ({"evaluations": 3}, "evaluations"),
        ({"budget": 3}, "budget"),
    ],
)
def test_what_cannot_be_meant_is_told_before_any_job(tmp_path: Path, search: dict[str, Any], told: str) -> None:
    with pytest.raises(UserError, match=told):
        load_study(study_file(tmp_path, search))
