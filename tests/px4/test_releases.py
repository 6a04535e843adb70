from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusetune.px4.aid_sources import SensorTopic
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS
from fusetune.px4.releases import BASELINE, DEVELOPMENT, DEVIATIONS, FIRST, NEWEST, READ, deviation_of, name_of


def test_all_releases_between_the_first_and_the_newest_are_read() -> None:
    assert (READ[0], READ[-1]) == (FIRST, NEWEST)
    assert BASELINE in READ
    assert SensorTopic("of_all_releases").since == FIRST


@pytest.mark.parametrize(
    ("release", "said"),
    [((1, 8, 2), "one source at a time"), ((1, 13, 3), "one source at a time"), ((1, 14, 0), "another error state")],
)
def test_what_an_old_release_does_otherwise_holds_for_its_last_patch_too(release: tuple[int, ...], said: str) -> None:
    assert said in deviation_of(release)  # type: ignore[arg-type]


def test_every_release_but_the_baseline_is_told_to_differ() -> None:
    assert [release for release in READ if not deviation_of(release)] == [BASELINE]
    assert deviation_of((*BASELINE, 2)) == ""
    assert deviation_of((2, 0, 0)) == deviation_of(NEWEST) == "its EKF2 is newer"
    assert [last for last, _ in DEVIATIONS] == sorted(last for last, _ in DEVIATIONS)


def test_parameters_know_no_release_beyond_those_that_are_read() -> None:
    named = {release for one in ALL_PARAMETERS.values() for release in (one.first_release, one.last_release)}
    named |= {since for one in ALL_PARAMETERS.values() for since, _ in one.default_history}
    assert named <= {*READ, DEVELOPMENT}


def test_texts_name_the_releases_that_are_read(project_root: Path) -> None:
    texts = [project_root / "README.md", *(project_root / "docs").glob("*.md"), *(project_root / "src").rglob("*.py")]
    said = [
        found for file in texts for found in re.findall(r"Logs of (v.+?) are read", file.read_text(encoding="utf-8"))
    ]
    assert said == [f"{name_of(FIRST)} to {name_of(NEWEST)}"]
