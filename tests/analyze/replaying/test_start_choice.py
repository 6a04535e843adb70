"""Warm or cold: by the log's time on the ground and by what it holds."""

from dataclasses import replace

import numpy as np

from fusetune.analyze.replaying.settings import StartSettings
from fusetune.analyze.replaying.start_choice import choose_start
from fusetune.px4.flight import Flight, ParameterHistory

BEGIN = 1_000_000


def state_rows(times, flags=True):
    n = len(times)
    states = {f"states[{i}]": np.full(n, 1.0 if i == 0 else 0.0) for i in range(25)}
    return {
        "timestamp": times + 100_000, "timestamp_sample": times, **states,
        **{f"covariances[{i}]": np.full(n, 0.01) for i in range(24)},
    }  # fmt: skip


def made(take_off_s, states_s, gnss_from_s=0.0):
    times = BEGIN + np.round(np.array(states_s) * 1e6).astype(np.int64)
    second = BEGIN + 1_000_000 * np.arange(60)
    topics = {
        ("sensor_combined", 0): {"timestamp": second},
        ("vehicle_land_detected", 0): {"timestamp": second, "landed": (np.arange(60) < take_off_s).astype(np.uint8)},
        ("vehicle_local_position", 0): {
            "timestamp": second, "x": np.zeros(60), "y": np.zeros(60), "ref_lat": np.full(60, 47.0),
            "ref_lon": np.full(60, 8.0), "ref_alt": np.full(60, 500.0), "xy_global": np.ones(60, bool),
        },
        ("estimator_status_flags", 0): {
            "timestamp": second, "cs_tilt_align": np.ones(60, bool), "cs_yaw_align": np.ones(60, bool),
            "cs_gnss_pos": np.arange(60) >= gnss_from_s,
        },
    }  # fmt: skip
    if len(times):
        topics["estimator_states", 0] = state_rows(times)
    return Flight("f", topics=topics, info={"ver_sw_release": 1 << 24 | 16 << 16 | 255}, parameters=ParameterHistory())


def test_log_that_begins_before_take_off_by_seconds_starts_warm():
    start = choose_start(made(3, np.arange(0.5, 50)))
    assert start.mode == "warm"
    assert start.state.time_us == BEGIN + 500_000


def test_log_with_time_on_the_ground_starts_cold():
    start = choose_start(made(40, np.arange(0.5, 50)))
    assert start.mode == "cold"
    assert "40 s before take-off" in start.why


def test_state_before_gnss_was_used_is_not_taken():
    start = choose_start(made(3, np.arange(0.5, 50), gnss_from_s=4))
    assert start.state.time_us == BEGIN + 4_500_000


def aligning(take_off_s, aligned_from_s, gnss_from_s, checked_s, name="cs_yaw_align"):
    """A log whose estimator aligns within it, with GNSS checks that have to hold for `checked_s`."""
    flight = made(take_off_s, np.arange(0.5, 50), gnss_from_s)
    flags = flight.topics["estimator_status_flags", 0] | {name: np.arange(60) >= aligned_from_s}
    parameters = ParameterHistory({"EKF2_REQ_GPS_H": checked_s})
    return replace(flight, topics=flight.topics | {("estimator_status_flags", 0): flags}, parameters=parameters)


def test_log_that_holds_the_start_of_the_vehicles_estimator_starts_cold():
    for name in ("cs_tilt_align", "cs_yaw_align"):
        start = choose_start(aligning(5, aligned_from_s=1, gnss_from_s=2, checked_s=0.5, name=name))
        assert start.mode == "cold"
        assert "aligned 1.0 s after the log began" in start.why
    asked = choose_start(aligning(5, aligned_from_s=1, gnss_from_s=2, checked_s=0.5), StartSettings(mode="warm"))
    assert asked.state.time_us == BEGIN + 2_500_000


def test_start_that_nothing_can_repeat_is_warm():
    # GNSS was checked before the log began
    assert choose_start(aligning(5, aligned_from_s=1, gnss_from_s=2, checked_s=10.0)).mode == "warm"
    # aligned in the air
    assert choose_start(aligning(5, aligned_from_s=7, gnss_from_s=12, checked_s=10.0)).mode == "warm"
    # never aligned
    assert "no state of an aligned" in choose_start(aligning(5, aligned_from_s=99, gnss_from_s=12, checked_s=10.0)).why


def test_late_state_is_no_use_to_auto_but_to_warm():
    flight = made(3, [20.5, 21.5])
    assert choose_start(flight).mode == "cold"
    assert choose_start(flight, StartSettings(mode="warm")).mode == "warm"


def test_log_without_states_starts_cold_and_says_so():
    start = choose_start(made(3, []))
    assert start.mode == "cold"
    assert "holds no state" in start.why


def test_cold_is_cold():
    assert choose_start(made(3, np.arange(0.5, 50)), StartSettings(mode="cold")).state is None


def test_states_of_no_layout_and_states_that_are_not_aligned_give_different_reasons():
    readable = made(3, np.arange(0.5, 50))
    flags = readable.topics["estimator_status_flags", 0]

    def with_flags(**changed):
        return readable.with_topics(readable.topics | {("estimator_status_flags", 0): flags | changed})

    unaligned = choose_start(with_flags(cs_yaw_align=np.zeros(60, bool)))
    assert unaligned.why == "the log holds no state of an aligned estimator"
    states = {name: column for name, column in readable.topics["estimator_states", 0].items() if name != "states[24]"}
    del states["covariances[22]"], states["covariances[23]"]
    unreadable = choose_start(readable.with_topics(readable.topics | {("estimator_states", 0): states}))
    assert "cannot be read: 24 states with 22 variances" in unreadable.why
    missing = {key: table for key, table in readable.topics.items() if key[0] != "estimator_status_flags"}
    assert "does not tell whether" in choose_start(readable.with_topics(missing)).why
    assert "holds no states" in choose_start(made(3, [])).why
    assert {unaligned.mode, unreadable.mode} == {"cold"}
