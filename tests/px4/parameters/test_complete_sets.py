"""Complete sets of older releases: v1.13 has others in the place of some parameters of v1.16, and each tells the other.

What a bit of EKF2_AID_MASK means is PX4's metadata of v1.13, and what stands for it in v1.16 is what PX4 itself makes
of it on an update (`parameter_migration`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pytest
from pyulog import ULog

from fusetune.analyze.replaying.set_input import WRITTEN_BACK, read_set_file
from fusetune.ekf2.filter.common.parameters import parameter_record, parameters_beside
from fusetune.px4.flight import ParameterValue
from fusetune.px4.parameters.complete_sets import complete
from fusetune.px4.parameters.ekf2_parameters import ParameterError, as_float32, defaults_of, parameters_of
from fusetune.px4.releases import BASELINE, ESTIMATORS, Release, number_of_name

V1_13, V1_14, V1_15, V1_16 = (1, 13), (1, 14), (1, 15), BASELINE


def completed(
    logged: Mapping[str, ParameterValue], overrides: Mapping[str, float] | None = None, release: Release = V1_13
) -> dict[str, float]:
    return complete(logged, overrides or {}, release, replayed=V1_13)


def test_what_the_log_of_an_old_release_has_is_what_its_estimator_reads() -> None:
    # bits 0, 6 and 8: GPS, rotated vision, vision velocity; v1.16 has nothing for the rotation
    values = completed({"EKF2_AID_MASK": 1 + 64 + 256, "EKF2_HGT_MODE": 2, "EKF2_RNG_AID": 0, "EKF2_WIND_NOISE": 0.2})
    assert (values["EKF2_AID_MASK"], values["EKF2_HGT_MODE"]) == (321.0, 2.0)
    assert (values["EKF2_RNG_AID"], values["EKF2_WIND_NOISE"]) == (0.0, as_float32(0.2))
    assert (values["EKF2_GPS_CTRL"], values["EKF2_EV_CTRL"], values["EKF2_HGT_REF"]) == (7.0, 4.0, 2.0)


def test_a_log_that_tells_nothing_has_the_defaults_of_the_release() -> None:
    """PX4's metadata: v1.13 has EKF2_AID_MASK 1, EKF2_RNG_AID 1, EKF2_MAG_YAWLIM 0.25, v1.14 the last one at 0.2."""
    values = completed({})
    assert (values["EKF2_AID_MASK"], values["EKF2_HGT_MODE"], values["EKF2_RNG_AID"]) == (1.0, 0.0, 1.0)
    assert values["EKF2_WIND_NOISE"] == as_float32(0.1)
    assert [defaults_of(one)["EKF2_MAG_YAWLIM"] for one in (V1_13, V1_14)] == [0.25, as_float32(0.2)]
    assert (values["SENS_BARO_RATE"], values["SENS_MAG_RATE"]) == (20.0, 15.0)


@pytest.mark.parametrize(
    ("logged", "own"),
    [
        ({"EKF2_GPS_CTRL": 7, "EKF2_OF_CTRL": 1, "EKF2_EV_CTRL": 0}, {"EKF2_AID_MASK": 1 + 2}),
        # v1.13 cannot use the velocity of GNSS alone, nor the height of vision without EKF2_HGT_MODE
        ({"EKF2_GPS_CTRL": 4, "EKF2_OF_CTRL": 0, "EKF2_EV_CTRL": 2}, {"EKF2_AID_MASK": 1}),
        ({"EKF2_GPS_CTRL": 8, "EKF2_OF_CTRL": 0, "EKF2_EV_CTRL": 15}, {"EKF2_AID_MASK": 128 + 8 + 16 + 256}),
        ({"EKF2_GPS_CTRL": 0, "EKF2_IMU_CTRL": 4, "EKF2_DRAG_CTRL": 1}, {"EKF2_AID_MASK": 4 + 32}),
        # unused in v1.14, where it stands beside those that count
        ({"EKF2_AID_MASK": 0, "EKF2_GPS_CTRL": 7}, {"EKF2_AID_MASK": 1}),
        ({"EKF2_HGT_REF": 1}, {"EKF2_HGT_MODE": 1}),
        ({"EKF2_RNG_CTRL": 2}, {"EKF2_RNG_AID": 1}),
        ({"EKF2_RNG_CTRL": 0}, {"EKF2_RNG_AID": 0}),
        ({"EKF2_WIND_NSD": 0.05}, {"EKF2_WIND_NOISE": as_float32(0.5)}),
    ],
)
def test_a_newer_log_has_what_comes_nearest(logged: dict[str, ParameterValue], own: dict[str, float]) -> None:
    values = completed(logged, release=V1_16)
    assert {name: values[name] for name in own} == own


def test_overrides_in_the_names_of_the_baseline_set_those_of_the_release() -> None:
    logged = {"EKF2_AID_MASK": 1 + 64, "EKF2_HGT_MODE": 0, "EKF2_RNG_AID": 1, "EKF2_WIND_NOISE": 0.1}
    wanted = {"EKF2_GPS_CTRL": 15, "EKF2_OF_CTRL": 1, "EKF2_HGT_REF": 1, "EKF2_RNG_CTRL": 0, "EKF2_WIND_NSD": 0.02}
    values = completed(logged, wanted)
    assert values["EKF2_AID_MASK"] == 1 + 2 + 64 + 128
    assert (values["EKF2_HGT_MODE"], values["EKF2_RNG_AID"]) == (1.0, 0.0)
    assert values["EKF2_WIND_NOISE"] == as_float32(0.2)
    assert {name: values[name] for name in wanted} == {name: as_float32(value) for name, value in wanted.items()}
    own = completed(logged, {"EKF2_AID_MASK": 2, "EKF2_WIND_NOISE": 0.3})
    assert (own["EKF2_AID_MASK"], own["EKF2_GPS_CTRL"], own["EKF2_OF_CTRL"]) == (2.0, 0.0, 1.0)
    assert own["EKF2_WIND_NSD"] == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({"EKF2_GRAV_NOISE": 2.0}, "EKF2_GRAV_NOISE: v1.13 has no such parameter, v1.14 to main have it"),
        ({"EKF2_VEL_LIM": 50.0}, "EKF2_VEL_LIM: v1.13 has no such parameter"),
        ({"EKF2_GPS_CTRL": 5}, "EKF2_AID_MASK: no value of it sets EKF2_GPS_CTRL = 5"),
        ({"EKF2_RNG_CTRL": 2}, "EKF2_RNG_AID: it would have to be 2 for EKF2_RNG_CTRL = 2"),
        ({"EKF2_HGT_REF": 3}, "it would change EKF2_EV_CTRL to 2 as well"),
        ({"EKF2_GPS_CTRL": 7, "EKF2_AID_MASK": 1}, "EKF2_AID_MASK: is what v1.13 has for EKF2_GPS_CTRL, also given"),
    ],
)
def test_what_a_release_cannot_do_is_refused_by_name(overrides: dict[str, float], said: str) -> None:
    with pytest.raises(ParameterError, match=said.replace(".", r"\.")):
        completed({"EKF2_AID_MASK": 1}, overrides)


def test_a_record_has_the_parameters_that_its_release_reads() -> None:
    assert parameters_beside("v1.16") == ()
    assert parameters_beside("v1.15") == ("EKF2_TERR_MASK",)
    assert {*parameters_beside("v1.13")} - {*parameters_beside("v1.14")} == {
        "EKF2_AID_MASK", "EKF2_HGT_MODE", "EKF2_RNG_AID", "EKF2_WIND_NOISE",
    }  # fmt: skip
    for name in ESTIMATORS:
        release = number_of_name(name)
        assert {*parameters_beside(name)} <= {*parameters_of(release)}
        record = parameter_record(complete({}, {}, release, replayed=release), name)
        for own in parameters_beside(name):
            assert float(record[own][0]) == defaults_of(release)[own]
    # kinds of fusion that v1.15 gave up
    for name, kind in (("v1.14", 2.0), ("v1.15", 0.0)):
        release = number_of_name(name)
        values = complete({}, {}, release, replayed=release) | {"EKF2_MAG_TYPE": 2.0}
        assert float(parameter_record(values, name)["EKF2_MAG_TYPE"][0]) == kind


def test_estimators_of_older_releases_have_the_parameters_that_they_had(
    shared_logs: Path, shared_reference_releases: Path
) -> None:
    """Every log and set that PX4's own EKF2 of these releases replayed, all its values, as float32."""
    compared = 0
    for name in ("v1.13", "v1.14", "v1.15"):
        release = number_of_name(name)
        for file in sorted((shared_reference_releases / name).glob("*/*.json")):
            log = ULog(str(shared_logs / f"{file.parent.name}.ulg"), message_name_filter_list=["none"])
            params, overrides = read_set_file(file, release)
            logged, flown = log.initial_parameters, log.get_version_info()[:3]
            used = complete(logged, overrides, flown, replayed=release, given=params)
            expected = json.loads(file.read_text())["params"]
            read = [one for one in expected if one in parameters_of(release) and one != WRITTEN_BACK]
            assert {one: used[one] for one in read} == {one: as_float32(expected[one]) for one in read}, file
            assert {*parameters_beside(name)} <= {*read}
            compared += 1
    assert compared >= 100
