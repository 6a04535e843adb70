"""Parameters that no vehicle can have flown with; ranges and defaults are those of PX4's metadata."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.ekf2.filter.common.parameters import parameter_record
from fusetune.px4.flight import Flight, ParameterChange, ParameterHistory, ReplacedParameter
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.complete_sets import complete
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS, PARAMETERS
from fusetune.px4.parameters.logged_parameters import checked_history, flown_limits, typed_value


def checked(initial, release=(1, 16, 0), **more):
    return checked_history(ParameterHistory(initial=dict(initial), **more), release)


@pytest.mark.parametrize(
    ("name", "value", "default"),
    [
        ("EKF2_EV_DELAY", 6e26, 0.0),
        ("EKF2_GPS_DELAY", math.nan, 110.0),
        ("EKF2_GPS_DELAY", math.inf, 110.0),
        ("EKF2_MAG_DELAY", -1e4, 0.0),
        ("EKF2_HGT_REF", 3e38, 1),
        ("EKF2_HGT_REF", 1.5, 1),
        ("EKF2_PREDICT_US", 0, 10000),
        ("EKF2_IMU_POS_X", 1e7, 0.0),
        ("SENS_MAG_RATE", -math.inf, 15.0),
        ("SDLOG_PROFILE", 2.0**40, 1),
    ],
)
def test_what_cannot_be_is_replaced_by_the_default_and_told(name, value, default):
    history, replaced = checked({name: value})
    assert history.initial == {name: default}
    (told,) = replaced
    assert (told.name, told.used, told.timestamp) == (name, default, None)
    assert told.value == value or math.isnan(value)


def test_the_default_is_that_of_the_release_that_flew_or_of_the_vehicle_where_the_log_tells():
    assert checked({"EKF2_EV_DELAY": math.nan}, (1, 12, 3))[0].initial["EKF2_EV_DELAY"] == 175.0
    own = {"default_system": {"EKF2_EV_DELAY": 30.0}, "default_current_setup": {"EKF2_EV_DELAY": 45.0}}
    assert checked({"EKF2_EV_DELAY": math.nan}, **own)[0].initial["EKF2_EV_DELAY"] == 45.0
    damaged = {"default_system": {"EKF2_EV_DELAY": 30.0}, "default_current_setup": {"EKF2_EV_DELAY": 1e30}}
    assert checked({"EKF2_EV_DELAY": math.nan}, **damaged)[0].initial["EKF2_EV_DELAY"] == 30.0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("EKF2_GPS_DELAY", 310.0),
        ("EKF2_MAG_DELAY", -20.0),
        ("EKF2_GPS_P_NOISE", 50.0),
        ("EKF2_REQ_HDRIFT", 10.0),
        ("EKF2_BARO_GATE", 1000.0),
        ("EKF2_DECL_TYPE", 7),
        ("EKF2_RNG_A_HMAX", 100.0),
        ("MPC_XY_P", 1e30),
    ],
)
def test_what_px4_would_have_flown_with_stays(name, value):
    """PX4 holds no parameter to its range when it loads it; a parameter that no room reads is not looked at."""
    history, replaced = checked({name: value})
    assert history.initial == {name: value}
    assert replaced == ()


def test_a_type_that_only_the_file_got_wrong_changes_no_value():
    history, replaced = checked({"EKF2_HGT_REF": 2.0, "EKF2_GPS_DELAY": 110, "EKF2_BARO_NOISE": 3})
    assert history.initial == {"EKF2_HGT_REF": 2, "EKF2_GPS_DELAY": 110.0, "EKF2_BARO_NOISE": 3.0}
    assert [type(value) for value in history.initial.values()] == [int, float, float]
    assert replaced == ()


def test_a_change_in_flight_to_what_cannot_be_is_left_out():
    changes = [
        ParameterChange(5, "EKF2_EV_DELAY", 20.0),
        ParameterChange(7, "EKF2_EV_DELAY", 6e26),
        ParameterChange(9, "EKF2_HGT_REF", 2.0),
        ParameterChange(11, "MPC_XY_P", math.inf),
    ]
    history, replaced = checked({"EKF2_EV_DELAY": 10.0}, changed=changes)
    assert history.changed == [changes[0], ParameterChange(9, "EKF2_HGT_REF", 2), changes[3]]
    assert replaced == (ReplacedParameter("EKF2_EV_DELAY", 6e26, 20.0, 7),)
    assert history.at_end()["EKF2_EV_DELAY"] == 20.0


def test_a_canonical_flight_is_checked_once_and_leaves_the_log_as_it_is():
    flight = Flight("f", parameters=ParameterHistory(initial={"EKF2_EV_DELAY": 6e26, "EKF2_HGT_REF": 3e38}))
    once = canonical(flight)
    assert once.parameters.initial == {"EKF2_EV_DELAY": 0.0, "EKF2_HGT_REF": 1}
    assert flight.parameters.initial["EKF2_EV_DELAY"] == 6e26
    assert canonical(once).replaced_parameters == once.replaced_parameters
    assert [one.name for one in once.replaced_parameters] == ["EKF2_EV_DELAY", "EKF2_HGT_REF"]


@pytest.mark.parametrize("name", ALL_PARAMETERS)
def test_every_default_of_every_release_can_have_flown(name):
    for _, default in ALL_PARAMETERS[name].default_history:
        assert typed_value(name, default) == default


@given(
    st.dictionaries(
        st.sampled_from(sorted(ALL_PARAMETERS)),
        st.one_of(st.floats(width=32), st.integers(-(2**31), 2**31 - 1)),
        max_size=30,
    ),
    st.sampled_from([None, (1, 8, 0), (1, 13, 3), (1, 16, 0), (1, 17, 0)]),
)
def test_whatever_a_log_holds_the_estimator_gets_finite_values_that_its_buffers_can_hold(logged, release):
    history, _ = checked(logged, release)
    values = complete(history.initial, {}, release)
    record = parameter_record(values)
    assert all(math.isfinite(record[name][0]) for name in PARAMETERS)
    for name, value in history.initial.items():
        low, high = flown_limits(name)
        assert low <= value <= high
    # the horizon stays within the 255 updates of 10 ms that the buffers hold
    assert record["EKF2_DELAY_MAX"][0] <= 2550.0
