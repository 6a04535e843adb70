from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.design.factors import factors_around
from fusetune.design.tunable_parameters import KINDS, TUNABLE_PARAMETERS
from fusetune.px4.aid_sources import AID_SOURCES, SENSORS
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, ParameterError, as_float32, check_value

ALL = list(TUNABLE_PARAMETERS)


def test_sane_ranges_lie_inside_the_metadata_and_hold_the_default() -> None:
    for one in TUNABLE_PARAMETERS.values():
        for value in (one.low, PARAMETERS[one.name].default, one.high):
            check_value(one.name, value)
        assert one.low <= PARAMETERS[one.name].default <= one.high


def test_kinds_are_those_of_the_aid_sources() -> None:
    measured = [one for one in AID_SOURCES.values() if one.is_replayed]
    kinds = {name: one.kind for name, one in TUNABLE_PARAMETERS.items()}
    for name, kind in kinds.items():
        if kind == "gate":
            assert name in {one.gate_parameter for one in AID_SOURCES.values()}
        if kind in ("gate", "delay", "measurement noise", "lever arm"):
            assert TUNABLE_PARAMETERS[name].sources
    assert all(kinds[one.gate_parameter] == "gate" for one in measured if one.gate_parameter)
    assert all(kinds[sensor.delay_parameter] == "delay" for sensor in SENSORS.values() if sensor.buffered)
    # EKF2_RNG_SFE scales with the distance and is 0 on many vehicles: it has no ratios
    noises = {name for one in measured for name in one.noises} - {"EKF2_RNG_SFE"}
    assert all(kinds[name] == "measurement noise" for name in noises)


def test_bounds_of_the_default_vehicle_by_hand() -> None:
    names = ["EKF2_GPS_V_NOISE", "EKF2_ACC_NOISE", "EKF2_GPS_DELAY", "EKF2_GPS_POS_X"]
    velocity, accelerometer, delay, arm = factors_around({}, names)
    assert (velocity.low, velocity.high) == pytest.approx((0.3 / 8, 2.4))
    assert (accelerometer.low, accelerometer.high) == pytest.approx((0.35 / 8, 1.0))  # PX4 takes no more than 1
    assert (delay.low, delay.high, delay.value(1.0), delay.value(-1.0)) == (10.0, 200.0, 150.0, 70.0)
    assert (arm.low, arm.high, arm.value(1.0)) == (-0.5, 0.5, as_float32(0.2))


def test_no_delay_moves_the_horizon() -> None:
    present = {"EKF2_DELAY_MAX": 120.0, "EKF2_GPS_DELAY": 110.0}
    assert factors_around(present, ["EKF2_GPS_DELAY"])[0].high == 120.0
    present["EKF2_OF_DELAY"] = 180.0  # by which PX4 itself makes the buffers longer
    assert factors_around(present, ["EKF2_GPS_DELAY"])[0].high == 180.0


def test_a_noise_of_zero_starts_at_the_lower_end() -> None:
    (factor,) = factors_around({"EKF2_ACC_B_NOISE": 0.0}, ["EKF2_ACC_B_NOISE"])
    assert (factor.origin, factor.low, factor.high) == (1e-4, 1e-4, 8e-4)


def test_a_value_outside_of_the_sane_range_stays_the_origin_and_reaches_it() -> None:
    (factor,) = factors_around({"EKF2_GPS_V_NOISE": 100.0}, ["EKF2_GPS_V_NOISE"])
    assert (factor.low, factor.origin, factor.high) == (3.0, 100.0, 100.0)


@pytest.mark.parametrize("name", ["EKF2_GPS_CTRL", "EKF2_ACC_NOISEE"])
def test_what_is_not_in_the_catalogue_is_told(name: str) -> None:
    with pytest.raises(ParameterError, match=name):
        factors_around({}, [name])


@given(
    st.sampled_from(ALL),
    st.one_of(st.floats(width=32), st.floats(-5.0, 400.0, width=32)),
    st.floats(-50.0, 50.0),
    st.floats(1.01, 100.0),
)
def test_whatever_flies_the_factor_is_sound(name: str, present: float, coordinate: float, ratio: float) -> None:
    (factor,) = factors_around({name: present}, [name], ratio=ratio)
    assert factor.low <= factor.origin <= factor.high
    low, high = factor.bounds
    assert low <= 0.0 <= high
    value = factor.value(coordinate)
    assert math.isfinite(value)
    slack = 1e-6 * max(abs(factor.low), abs(factor.high)) + factor.grid
    assert factor.low - slack <= value <= factor.high + slack
    # 32 bits hold no multiple of 10 exactly beyond 2 ** 24
    if factor.grid and factor.high - factor.low >= factor.grid and max(abs(factor.low), abs(factor.high)) < 1e6:
        assert value % factor.grid == 0.0
        assert factor.low <= value <= factor.high
    if math.isfinite(present) and (present > 0.0 or KINDS[TUNABLE_PARAMETERS[name].kind].scale == "linear"):
        assert factor.origin == present
