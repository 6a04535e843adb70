"""Parameters of the baseline on vehicles of other releases."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.px4.flight import ParameterValue
from fusetune.px4.parameters.ekf2_parameters import (
    ALL_PARAMETERS,
    PARAMETERS,
    ParameterError,
    as_float32,
    migrate,
)
from fusetune.px4.parameters.release_names import VehicleParameter, on_vehicle
from fusetune.px4.releases import DEVELOPMENT, READ, Release


def logged_by(release: Release) -> dict[str, ParameterValue]:
    """All EKF2 parameters that a vehicle of a release has, at their defaults."""
    values: dict[str, ParameterValue] = {}
    for name, one in ALL_PARAMETERS.items():
        if one.exists_in(release):
            default = one.default_in(release)
            values[name] = int(default) if one.type == "INT32" else default
    return values


def only(wanted: dict[str, float], logged: dict[str, ParameterValue], release: Release | None) -> VehicleParameter:
    (one,), refused = on_vehicle(wanted, logged, release)
    assert refused == ()
    return one


def refusal(wanted: dict[str, float], logged: dict[str, ParameterValue], release: Release | None) -> ParameterError:
    found, (error,) = on_vehicle(wanted, logged, release)
    assert found == ()
    return error


def test_what_took_another_name_is_set_by_that() -> None:
    # main: EKF2_GPS_DELAY became SENS_GPS0_DELAY (PX4, docs of releases); still read when the driver starts
    one = only({"EKF2_GPS_DELAY": 160.0}, {"SENS_GPS0_DELAY": 110.0}, DEVELOPMENT)
    assert (one.name, one.previous, one.value, one.reboot_required) == ("SENS_GPS0_DELAY", 110.0, 160.0, True)
    assert one.stands_for == ("EKF2_GPS_DELAY",)
    one = only({"EKF2_RNG_CTRL": 0}, logged_by((1, 13)) | {"EKF2_RNG_AID": 1}, (1, 13))
    assert (one.name, one.value, one.type) == ("EKF2_RNG_AID", 0, "INT32")


def test_wind_noise_before_v1_14_is_ten_times_the_density() -> None:
    # PX4's own migration: the standard deviation of a step at 100 Hz, sqrt(100) times the density
    one = only({"EKF2_WIND_NSD": 0.025}, logged_by((1, 12)) | {"EKF2_WIND_NOISE": as_float32(0.1)}, (1, 12))
    assert (one.name, one.value) == ("EKF2_WIND_NOISE", as_float32(0.25))


def test_control_bits_before_v1_14_are_those_of_the_mask() -> None:
    # EKF2_AID_MASK: 1 GPS, 2 flow, 4 no accelerometer bias, 32 drag, 64 rotated vision, which nothing may lose
    logged = logged_by((1, 13)) | {"EKF2_AID_MASK": 65}
    one = only({"EKF2_DRAG_CTRL": 1, "EKF2_OF_CTRL": 1, "EKF2_IMU_CTRL": 0b101}, logged, (1, 13))
    assert (one.name, one.value) == ("EKF2_AID_MASK", 65 + 32 + 2 + 4)
    assert one.stands_for == ("EKF2_DRAG_CTRL", "EKF2_IMU_CTRL", "EKF2_OF_CTRL")
    error = refusal({"EKF2_EV_CTRL": 0b0001}, logged, (1, 13))
    assert "no value of it sets EKF2_EV_CTRL = 1" in error.reason


@pytest.mark.parametrize(
    ("wanted", "logged", "release", "said"),
    [
        ({"EKF2_GRAV_NOISE": 2.0}, logged_by((1, 13)), (1, 13), "v1.13, which the vehicle flies, .* came with v1.14"),
        ({"EKF2_RNG_A_IGATE": 2.0}, logged_by((1, 17)), (1, 17), "went after v1.16"),
        ({"EKF2_GRAV_NOISE": 2.0}, {}, None, "does not say which release"),
        ({"EKF2_WIND_NSD": 0.5}, logged_by((1, 13)), (1, 13), "EKF2_WIND_NOISE: .* 5 is out of range"),
        ({"EKF2_ACC_NOISE": 2.0}, logged_by((1, 16)), (1, 16), "2 is out of range"),
        ({"EKF2_PCOEF_YN": 0.1}, logged_by((1, 8)), (1, 8), "would change EKF2_PCOEF_YP to 0.1 as well"),
        ({"EKF2_PCOEF_YN": 0.1, "EKF2_PCOEF_YP": 0.2}, logged_by((1, 8)), (1, 8), "no value of it sets"),
        # a firmware of one's own that holds it as a whole number
        ({"EKF2_GPS_DELAY": 112.5}, {"EKF2_GPS_DELAY": 110}, (1, 16), "112.5 is no whole number"),
    ],
)
def test_what_a_release_cannot_have_is_refused_with_the_reason(
    wanted: dict[str, float], logged: dict[str, ParameterValue], release: Release | None, said: str
) -> None:
    found, errors = on_vehicle(wanted, logged, release)
    assert found == ()
    assert re.search(said, str(errors[0]))


def test_a_parameter_that_is_not_in_use_has_the_default_of_its_own_release() -> None:
    one = only({"EKF2_MAG_NOISE": 0.03}, {}, (1, 14))
    assert (one.is_logged, one.previous) == (False, PARAMETERS["EKF2_MAG_NOISE"].default_in((1, 14)))


def within(name: str) -> st.SearchStrategy[float]:
    one = PARAMETERS[name]
    if one.kind == "boolean":
        return st.sampled_from([0.0, 1.0])
    if one.kind == "bitmask":
        return st.integers(0, (1 << max(one.values) + 1) - 1).map(float)
    if one.values:
        return st.sampled_from([float(value) for value in one.values])
    low, high = one.minimum or 0.0, one.maximum if one.maximum is not None else (one.minimum or 0.0) + 20.0
    if one.type == "INT32":
        return st.integers(math.ceil(low), math.floor(high)).map(float)
    return st.floats(as_float32(low), as_float32(high), width=32)


@settings(deadline=None, max_examples=200)
@given(data=st.data())
def test_every_release_gets_what_was_wanted_or_the_reason(data: st.DataObject) -> None:
    release = data.draw(st.sampled_from([*READ, DEVELOPMENT]))
    names = data.draw(st.lists(st.sampled_from(sorted(PARAMETERS)), min_size=1, max_size=6, unique=True))
    wanted = {name: data.draw(within(name)) for name in names}
    logged = logged_by(release)
    found, refused = on_vehicle(wanted, logged, release)
    before = migrate(logged, release)
    after = migrate({**logged, **{one.name: one.value for one in found}}, release)
    told = {name for one in found for name in one.stands_for}
    for name in told:
        assert after[name] == pytest.approx(as_float32(wanted[name]), rel=1e-6)
    for name in set(after) & set(before) - told:
        assert after[name] == before[name]
    # what is neither set nor refused is what the vehicle has
    if not refused:
        for name in set(wanted) - told:
            assert before[name] == as_float32(wanted[name])
    for one in found:
        assert isinstance(one.value, int) == (one.type == "INT32")


def test_what_only_newer_releases_have_is_set_on_these_and_refused_by_name_on_others() -> None:
    newer, older = (1, 17), (1, 14)
    assert only({"EKF2_GPS_MODE": 1.0}, logged_by(newer), newer).value == 1
    refused = refusal({"EKF2_GPS_MODE": 1.0}, logged_by(older), older)
    assert (refused.name, "came with v1.17" in refused.reason) == ("EKF2_GPS_MODE", True)
