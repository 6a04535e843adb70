"""Which release flew, by commit, number, parameters and flags.

What a release has is said by PX4's parameter metadata (`px4/parameters/ekf2_parameters.csv`) and by the fields of its
message `EstimatorStatusFlags.msg`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from fusetune.px4.flight import Flight, ParameterHistory, ParameterValue
from fusetune.px4.flown_release import FlownRelease, flown_release
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS
from fusetune.px4.release_signs import FLAG_SPANS
from fusetune.px4.release_tags import DIGITS, TAGS
from fusetune.px4.releases import DEVELOPMENT, READ, Release, estimator_name
from fusetune.px4.ulog.reader import read_ulog

RELEASES = (*READ, DEVELOPMENT)
ALPHA_OF_17, BETA_OF_15 = 0x01110040, 0x010F0080


def parameters_of(release: Release) -> dict[str, ParameterValue]:
    return {name: one.default_in(release) for name, one in ALL_PARAMETERS.items() if one.exists_in(release)}


def flags_of(release: Release) -> tuple[str, ...]:
    return tuple(name for name, (first, last) in FLAG_SPANS.items() if first <= release <= last)


def of(release: Release | None = None, flags: tuple[str, ...] = (), **info: Any) -> FlownRelease:
    history = ParameterHistory({} if release is None else parameters_of(release))
    return flown_release(Flight("f", parameters=history, info=info, release_signs=flags))


@pytest.mark.parametrize("release", RELEASES, ids=estimator_name)
def test_a_log_without_a_number_is_told_by_its_parameters_and_flags(release: Release) -> None:
    assert of(release, flags_of(release)).name == estimator_name(release)


def test_what_the_log_names_counts_where_nothing_speaks_against_it() -> None:
    for commit, tag in TAGS.items():
        assert len(commit) == DIGITS
        flown = of(ver_sw=f"{commit}cafe")
        assert flown.name == tag.name.rpartition(".")[0]
        assert f"{tag.name} of {tag.date}" in flown.evidence
    assert of(ver_sw_release=0x010D03FF).name == "v1.13"
    assert of(ver_sw_release=0x010600FF).name == "v1.6"
    assert of(ver_sw_release=0x020000FF).name == "main"
    assert of(ver_sw_branch="release/1.14").name == "v1.14"
    assert of(ver_sw_branch="feature/2.1.14").name == of().name == "unknown"


def test_a_build_between_releases_is_the_one_whose_parameters_it_has() -> None:
    """PX4 names development builds after the last tag; the parameters are those of what is built."""
    main = of(DEVELOPMENT, ver_sw_release=ALPHA_OF_17)
    assert (main.release, main.name) == (DEVELOPMENT, "main")
    assert "names v1.17.0-alpha, but EKF2_AGP0_CTRL" in main.evidence
    assert of((1, 17), ver_sw_release=ALPHA_OF_17).name == "v1.17"
    assert of((1, 16), ver_sw_release=BETA_OF_15).name == "v1.16"
    # by flags alone, where the log has no parameters
    assert of(None, flags_of((1, 16)), ver_sw_release=BETA_OF_15).name == "v1.16"


def test_one_odd_parameter_is_no_other_release_and_those_of_a_fork_are_named() -> None:
    odd = parameters_of((1, 16)) | {"EKF2_GPS_MODE": 0, "EKF2_ENGINE_WRM": 1}
    flown = flown_release(Flight("f", parameters=ParameterHistory(odd), info={"ver_sw_release": 0x011000FF}))
    assert (flown.name, flown.own_parameters) == ("v1.16", ("EKF2_ENGINE_WRM",))


@pytest.mark.parametrize(
    ("log", "name"),
    [("erdemarslan380__sitl_windy", "main"), ("PX4__ekf_failure", "v1.16"), ("JAParedes__TestFlight1", "v1.12")],
)
def test_real_development_builds_are_told(shared_logs: Path, log: str, name: str) -> None:
    """The first is known to be main of March 2026, the others carry numbers of the release before."""
    assert flown_release(read_ulog(shared_logs / f"{log}.ulg")).name == name
