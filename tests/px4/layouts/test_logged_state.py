"""Logged states of old and new releases in one layout; expected values by hand."""

import numpy as np
import pytest

from fusetune.px4.flight import Flight, ParameterHistory
from fusetune.px4.layouts.logged_state import logged_handovers, logged_states, rotation_variances, why_no_state
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.layouts.state_layout import state_layout

HORIZON = 5_000_000


def release(major, minor):
    return {"ver_sw_release": major << 24 | minor << 16 | 255}


def table(**columns):
    result = {}
    for name, value in columns.items():
        for i, one in enumerate(np.atleast_1d(value)):
            result[f"{name}[{i}]" if np.ndim(value) else name] = np.array([one])
    return result


def made_flight(info, states, covariances, *, lag=100_000, parameters=None, **local):
    origin = {"ref_lat": 47.0, "ref_lon": 8.0, "ref_alt": 500.0, "xy_global": True, "x": 3.0, "y": 4.0, "z": -5.0}
    stamp = {"timestamp": HORIZON + lag, "timestamp_sample": HORIZON if lag > 20_000 else HORIZON + lag}
    topics = {
        ("estimator_states", 0): table(states=states, covariances=covariances, **stamp),
        ("vehicle_local_position", 0): table(timestamp=HORIZON, timestamp_sample=HORIZON, **(origin | local)),
        ("estimator_status_flags", 0): table(
            timestamp=HORIZON - 1, cs_tilt_align=True, cs_yaw_align=True, cs_gnss_pos=True, cs_in_air=False
        ),
    }
    return Flight("f", topics=topics, info=info, parameters=ParameterHistory(initial=parameters or {}))


def test_states_of_v1_13_become_rates_and_rotations():
    states = np.arange(24, dtype=float) * 1e-3
    states[:4] = [1.0, 0.0, 0.0, 0.0]
    covariances = np.full(24, 1e-6)
    covariances[:4] = [0.0, 2.5e-5, 5e-5, 2.5e-4]
    state = next(logged_states(made_flight(release(1, 13), states, covariances)))
    assert state.time_us == HORIZON
    np.testing.assert_allclose(state.position, [7e-3, 8e-3, 9e-3])
    np.testing.assert_allclose(state.gyro_bias, np.array([10, 11, 12]) * 1e-3 / 0.01)
    # level and facing north, a quaternion component is half the rotation: variances are four times as large
    np.testing.assert_allclose(state.variances[:3], [1e-4, 2e-4, 1e-3])
    np.testing.assert_allclose(state.variances[9:15], 1e-2)
    np.testing.assert_allclose(state.variances[15:23], 1e-6)
    assert state.variances[23] == 0.0
    assert state.origin == (47.0, 8.0, 500.0)
    assert state.is_aligned
    assert state.uses_gnss
    assert "in_air" not in state.flags


def test_states_of_v1_15_are_rates_already():
    states = np.zeros(24)
    states[0], states[10] = 1.0, 0.02
    state = next(logged_states(made_flight(release(1, 15), states, np.arange(23) * 1e-4)))
    assert state.gyro_bias[0] == 0.02
    np.testing.assert_allclose(state.variances[:23], np.arange(23) * 1e-4)
    assert state.variances[23] == 0.0
    np.testing.assert_allclose(state.position, [0.0, 0.0, 0.0])


def states_with(size, **named):
    states = np.zeros(size)
    states[0], states[4:7], states[16:19] = 1.0, [1.0, 2.0, 3.0], [0.2, 0.0, 0.4]
    for name, value in named.items():
        states[int(name.removeprefix("s"))] = value
    return states


QUATERNION = {"s7": 7.0, "s8": 8.0, "s9": -9.0}
INCREMENTS, RATES = np.full(24, 1e-6), np.full(24, 1e-3)


@pytest.mark.parametrize("info", [release(1, 13), release(1, 15), release(1, 16), {}])
@pytest.mark.parametrize(
    ("states", "covariances", "gyro_bias", "position", "bias_variance"),
    [
        (states_with(24, s10=2e-4, **QUATERNION), INCREMENTS, 0.02, [7.0, 8.0, -9.0], 1e-2),
        (states_with(24, s10=0.02, **QUATERNION), RATES, 0.02, [7.0, 8.0, -9.0], 1e-3),
        (states_with(24, s10=0.02, **QUATERNION), RATES[:23], 0.02, [7.0, 8.0, -9.0], 1e-3),
        (states_with(25, s10=0.02, **QUATERNION), RATES, 0.02, [7.0, 8.0, -9.0], 1e-3),
        (states_with(25, s10=0.02, s9=-509.0), RATES, 0.02, [3.0, 4.0, -9.0], 1e-3),
    ],
    ids=["v1.8 to v1.14", "July 2023", "v1.15", "May 2024", "v1.16"],
)
def test_the_layout_is_told_by_the_data_and_not_by_the_release(
    info, states, covariances, gyro_bias, position, bias_variance
):
    """Counts as in each layout's messages; an update of 0.01 s makes rates of increments."""
    state = next(logged_states(made_flight(info, states, covariances)))
    assert state.gyro_bias[0] == pytest.approx(gyro_bias)
    np.testing.assert_allclose(state.position, position)
    np.testing.assert_allclose(state.velocity, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(state.variances[9:15], bias_variance)
    np.testing.assert_allclose(state.mag_earth, [0.2, 0.0, 0.4])


def test_biases_that_the_log_also_tells_as_rates_decide_what_the_states_are():
    """The variances are those of increments; the states themselves are as large as the rates."""
    flight = made_flight(release(1, 15), states_with(24, s10=0.02, s13=0.1), INCREMENTS)
    rates = table(timestamp=HORIZON, gyro_bias=[0.02, 0.0, 0.0], accel_bias=[0.1, 0.0, 0.0])
    flight = flight.with_topics(flight.topics | {("estimator_sensor_bias", 0): rates})
    state = next(logged_states(flight))
    assert state.gyro_bias[0] == 0.02
    np.testing.assert_allclose(state.variances[9:15], 1e-6)


def test_damaged_rows_do_not_change_the_layout():
    """One row in twenty with flipped bits: a place where none is a state, variances of rates, a count of states."""
    sound = made_flight(release(1, 16), states_with(25, s9=-509.0), np.full(24, 1e-3))
    rows = {name: np.repeat(values, 20) for name, values in sound.topics["estimator_states", 0].items()}
    rows["n_states"] = np.full(20, 25.0)
    rows["states[7]"][3], rows["states[8]"][4], rows["n_states"][5] = 1e9, np.nan, np.nan
    assert not state_layout(rows).has_local_position
    old = made_flight(release(1, 13), states_with(24, s10=2e-4, **QUATERNION), INCREMENTS)
    rows = {name: np.repeat(values, 20) for name, values in old.topics["estimator_states", 0].items()}
    rows["covariances[14]"][3], rows["covariances[13]"][4] = 1e30, np.nan
    assert not state_layout(rows).has_bias_rates


@pytest.mark.parametrize("lost", ["gyro_bias[0]", "gyro_bias[2]", "accel_bias[1]"])
def test_a_table_of_biases_that_lost_a_component_is_not_asked(lost):
    flight = made_flight(release(1, 13), states_with(24, s10=2e-4), INCREMENTS)
    rates = table(timestamp=HORIZON, gyro_bias=[0.3, 0.0, 0.0], accel_bias=[0.1, 0.0, 0.0])
    del rates[lost]
    flight = flight.with_topics(flight.topics | {("estimator_sensor_bias", 0): rates})
    assert next(logged_states(flight)).gyro_bias[0] == pytest.approx(0.02)


def test_unreadable_and_unaligned_states_are_told_apart():
    sound = made_flight(release(1, 15), states_with(24), np.ones(23))
    assert why_no_state(sound) == ""
    assert "24 states with 20 variances" in why_no_state(made_flight(release(1, 15), states_with(24), np.ones(20)))
    assert "10 states" in why_no_state(made_flight(release(1, 8), np.ones(10), np.ones(10)))
    nowhere = sound.with_topics({key: one for key, one in sound.topics.items() if key[0] != "vehicle_local_position"})
    assert "lacks vehicle_local_position" in why_no_state(nowhere)
    assert "holds no states" in why_no_state(sound.with_topics({}))
    assert "none is a number" in why_no_state(made_flight(release(1, 15), states_with(24, s5=np.nan), np.ones(23)))


def test_position_of_v1_16_comes_from_the_local_position():
    states = np.zeros(25)
    states[0], states[9] = 1.0, -510.0
    state = next(logged_states(made_flight(release(1, 16), states, np.full(24, 0.5))))
    np.testing.assert_allclose(state.position, [3.0, 4.0, -10.0])
    assert state.variances[23] == 0.5


def test_sample_time_of_the_newest_imu_is_moved_back_by_the_longest_delay():
    states = np.zeros(24)
    states[0] = 1.0
    delays = {"EKF2_GPS_DELAY": 110.0, "EKF2_EV_DELAY": 175.0, "EKF2_MAG_DELAY": 0.0}
    flight = made_flight(release(1, 12), states, np.ones(24), lag=1_000, parameters=delays)
    assert next(logged_states(flight)).time_us == HORIZON + 1_000 - 175_000


def test_a_damaged_delay_does_not_move_the_horizon():
    delays = {"EKF2_GPS_DELAY": 110.0, "EKF2_EV_DELAY": 6e26, "EKF2_OF_DELAY": np.inf, "EKF2_MAG_DELAY": -1e30}
    flight = made_flight(release(1, 14), states_with(24), np.ones(24), lag=1_000, parameters=delays)
    assert next(logged_states(canonical(flight))).time_us == HORIZON + 1_000 - 110_000


def test_origin_far_from_the_fix_is_put_there():
    states = np.zeros(25)
    states[0], states[9] = 1.0, -510.0
    flight = made_flight(release(1, 16), states, np.ones(24))
    fix = table(timestamp=HORIZON, latitude_deg=37.0, longitude_deg=8.0, fix_type=3)
    flight = flight.with_topics(flight.topics | {("vehicle_gps_position", 0): fix})
    latitude, longitude, altitude = next(logged_states(flight)).origin
    assert latitude == pytest.approx(37.0 - 3.0 / 111_195)
    assert longitude == pytest.approx(8.0 - 4.0 / 111_195 / np.cos(np.radians(37.0)))
    assert altitude == 500.0


def test_states_that_are_no_numbers_are_left_out():
    states = np.zeros(24)
    states[0], states[5] = 1.0, np.nan
    assert not list(logged_states(made_flight(release(1, 13), states, np.ones(24))))


@pytest.mark.parametrize("yaw", [0.0, 0.4, 2.0, -2.8])
def test_rotation_variances_invert_the_quaternions(yaw):
    """Variances ¼ Σ B² var θ, made by hand for a level attitude."""
    wanted = np.array([1e-4, 3e-4, 2e-3])
    c, s = np.cos(yaw / 2), np.sin(yaw / 2)
    quaternion = 0.25 * np.array(
        [
            s**2 * wanted[2],
            c**2 * wanted[0] + s**2 * wanted[1],
            s**2 * wanted[0] + c**2 * wanted[1],
            c**2 * wanted[2],
        ]
    )
    found = rotation_variances(np.array([c, 0.0, 0.0, s]), quaternion)
    assert found[2] == pytest.approx(wanted[2])
    np.testing.assert_allclose(found[:2], wanted[:2], rtol=1e-6)


def two_instances(second_horizon):
    """Instance 1, with a gyro bias of its own, becomes primary at 5.5 s."""
    states = np.zeros(24)
    states[0] = 1.0
    flight = made_flight(release(1, 15), states, np.arange(23) * 1e-4)
    states[10] = 0.02
    stamp = {"timestamp": second_horizon + 100_000, "timestamp_sample": second_horizon}
    selector = {"timestamp": np.array([1_000_000, 5_500_000, 6_000_000]), "primary_instance": np.array([0, 1, 1])}
    return flight.with_topics(
        flight.topics
        | {
            ("estimator_states", 1): table(states=states, covariances=np.arange(23) * 1e-4, **stamp),
            ("estimator_selector_status", 0): selector,
        }
    )


def test_a_handover_comes_with_the_state_of_the_new_primary_instance():
    (handover,) = logged_handovers(two_instances(4_900_000))
    assert handover.time_us == 5_500_000
    assert handover.state.time_us == 4_900_000
    np.testing.assert_allclose(handover.state.gyro_bias, [0.02, 0.0, 0.0])


def test_a_state_long_before_tells_nothing_of_a_handover():
    assert logged_handovers(two_instances(200_000)) == ()


def test_one_instance_hands_nothing_over():
    states = np.zeros(24)
    states[0] = 1.0
    assert logged_handovers(made_flight(release(1, 15), states, np.zeros(23))) == ()
