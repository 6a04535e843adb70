"""Checks of the range finder's samples, with sequences worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import make_estimator, rotation_matrix

from fusetune.ekf2.filter.aid_sources.range_finder.range_finder_consistency_check import (
    MISTAKEN_MOTION_HOLD,
    MOTION_HOLD,
    update_range_consistency,
)
from fusetune.ekf2.filter.aid_sources.range_finder.range_memory import dist_bottom, is_data_healthy, update_cos_tilt
from fusetune.ekf2.filter.aid_sources.range_finder.sensor_range_finder import run_range_sensor_checks

QUALITY_HYSTERESIS_S = 1.0
PERIOD_US = 50_000


class Sensor:
    """A range finder at 20 Hz, checked every 10 ms like in the filter."""

    def __init__(self, time_s: float = 1.0, fog_distance: float = 0.0):
        self.rng = make_estimator()["range"]
        self.rng["sensor_min_distance"] = 0.1
        self.rng["sensor_max_distance"] = 40.0
        self.fog_distance = fog_distance
        self.time_us = round(time_s * 1e6)

    def measure(self, distance: float, quality: int = 100, delay_us: int = 7_000) -> bool:
        """One sample and the updates until the next; return whether the sample was healthy."""
        self.time_us += PERIOD_US
        self.rng["sample"]["time_us"] = self.time_us - delay_us
        self.rng["sample"]["range"] = distance
        self.rng["sample"]["quality"] = quality
        self.rng["is_sample_ready"] = True
        run_range_sensor_checks(self.rng, self.time_us, QUALITY_HYSTERESIS_S, self.fog_distance)
        healthy = bool(is_data_healthy(self.rng))
        self.rng["is_sample_ready"] = False
        for i in range(1, 5):
            run_range_sensor_checks(self.rng, self.time_us + i * 10_000, QUALITY_HYSTERESIS_S, self.fog_distance)
        return healthy

    def pause(self, seconds: float) -> None:
        for _ in range(round(seconds * 100)):
            self.time_us += 10_000
            run_range_sensor_checks(self.rng, self.time_us, QUALITY_HYSTERESIS_S, self.fog_distance)


@pytest.mark.parametrize(
    ("distance", "healthy"), [(0.09, False), (0.1, True), (20.0, True), (40.0, True), (40.1, False)]
)
def test_distance_within_the_sensor_limits(distance, healthy):
    assert Sensor().measure(distance) == healthy


def test_quality_zero_is_held_against_the_sensor_for_a_second():
    sensor = Sensor(time_s=5.0)
    assert sensor.measure(3.0)
    assert not sensor.measure(3.0, quality=0)
    verdicts = [sensor.measure(3.0) for _ in range(21)]
    # 1.00 s later is not more than a second later, 1.05 s is
    assert verdicts == [False] * 20 + [True]


def test_unknown_quality_is_accepted():
    assert Sensor().measure(3.0, quality=-1)


@pytest.mark.parametrize(("tilt_deg", "healthy"), [(44.0, True), (46.0, False)])
def test_tilt_limit(tilt_deg, healthy):
    sensor = Sensor()
    half = np.radians(tilt_deg) / 2
    update_cos_tilt(sensor.rng, rotation_matrix(np.array([np.cos(half), np.sin(half), 0.0, 0.0])), 0.0)
    assert sensor.measure(3.0) == healthy
    assert dist_bottom(sensor.rng) == pytest.approx(3.0 * np.cos(np.radians(tilt_deg)))


def test_mounting_pitch_is_part_of_the_tilt():
    sensor = Sensor()
    half = np.radians(30.0) / 2
    R = rotation_matrix(np.array([np.cos(half), 0.0, np.sin(half), 0.0]))  # nose up
    update_cos_tilt(sensor.rng, R, np.radians(20.0))
    # body z turned by 20° about y points at x sin 20° + z cos 20°; nose up adds to it
    assert sensor.rng["cos_tilt"] == pytest.approx(np.cos(np.radians(50.0)))


def test_stuck_until_the_distance_varies():
    """More than ten seconds out of range: then a constant distance is not trusted, a varying one is."""
    sensor = Sensor(time_s=1.0)
    assert sensor.measure(3.0)
    assert not any(sensor.measure(50.0) for _ in range(200))
    assert not sensor.measure(2.0)
    assert not sensor.measure(2.05)
    assert not sensor.measure(2.09)  # max - min 0.09
    assert not sensor.measure(2.12)  # the span is compared before it takes this sample in
    assert sensor.measure(2.12)  # 0.12 m of span
    assert sensor.measure(2.12)


def test_ten_seconds_out_of_range_are_not_yet_stuck():
    sensor = Sensor(time_s=1.0)
    assert sensor.measure(3.0)
    assert not any(sensor.measure(50.0) for _ in range(199))
    assert sensor.measure(3.0)


def test_irregular_data():
    sensor = Sensor(time_s=1.0)
    assert sensor.measure(3.0)
    assert sensor.rng["is_regularly_sending_data"]
    sensor.pause(0.35)
    assert sensor.rng["is_regularly_sending_data"]
    sensor.pause(0.1)  # 2 x 0.2 s since the sample
    assert not sensor.rng["is_regularly_sending_data"]
    assert not sensor.rng["is_sample_valid"]


def test_delay_filter_follows_its_closed_form():
    rng = make_estimator()["range"]
    rng["sample"]["time_us"] = 1_000_000
    for _ in range(100):
        run_range_sensor_checks(rng, 1_300_000, QUALITY_HYSTERESIS_S, 0.0)
    assert rng["dt_data_lpf"] == pytest.approx(300_000 * (1 - 0.995**100))


def test_fog_blocks_after_a_drop_and_frees_after_a_climb():
    """Median of 5: three near samples bring it from 12 m to 1 m, which is a drop of 11 m, more than twice 3 m."""
    sensor = Sensor(fog_distance=3.0)
    assert all(sensor.measure(12.0) for _ in range(10))
    assert [sensor.measure(1.0) for _ in range(5)] == [True, True, False, False, False]
    assert sensor.rng["is_blocked"]
    # free again when the median exceeds twice 3 m: with the third far sample
    assert [sensor.measure(7.0) for _ in range(4)] == [False, False, True, True]


def test_a_slow_descent_is_not_fog():
    sensor = Sensor(fog_distance=3.0)
    assert all(sensor.measure(distance) for distance in np.linspace(12.0, 0.5, 60))


def test_fog_check_switched_off():
    sensor = Sensor(fog_distance=0.0)
    assert all(sensor.measure(distance) for distance in (12.0, 12.0, 12.0, 12.0, 1.0, 1.0, 1.0, 1.0))


class Consistency:
    """Distances at 20 Hz against a vertical velocity."""

    def __init__(self, hold_us: int = MISTAKEN_MOTION_HOLD):
        self.rng = make_estimator()["range"]
        self.time_us = 1_000_000
        self.distance = 5.0
        self.hold_us = hold_us

    def fly(self, seconds: float, climb_rate: float, vz: float, horizontal_motion: bool = False) -> list[bool]:
        verdicts = []
        for _ in range(round(seconds / 0.05)):
            self.time_us += PERIOD_US
            self.distance += climb_rate * 0.05
            update_range_consistency(
                self.rng, self.distance, 0.01, vz, 0.01, horizontal_motion, self.hold_us, self.time_us, 1.0
            )
            verdicts.append(bool(self.rng["is_kinematically_consistent"]))
        return verdicts


def test_consistency_innovation_and_variance():
    check = Consistency()
    check.fly(0.05, 0.0, 0.0)
    check.fly(0.05, 2.0, -1.5)
    # climbing at 2 m/s by the distance, at 1.5 m/s by the filter (down positive)
    assert check.rng["kin_innovation"] == pytest.approx(-0.5)
    assert check.rng["kin_innovation_variance"] == pytest.approx(2 * 0.01 / 0.05**2 + 0.01)
    ratio = 0.25 / (2 * 0.01 / 0.05**2 + 0.01)
    assert check.rng["kin_test_ratio"] == pytest.approx(ratio)
    assert check.rng["kin_signed_test_ratio_lpf"] == pytest.approx(-ratio * 0.05 / 2.05)


def test_distance_that_climbs_alone_is_inconsistent_until_shown_otherwise():
    check = Consistency()
    assert all(check.fly(2.0, 0.0, 0.0))
    verdicts = check.fly(5.0, 6.0, 0.0)
    # ratio 36 / 8.01 = 4.494, filtered with 1 - (2/2.05)^n: reaches 1 with the 11th difference
    assert verdicts.index(False) == 10
    assert not any(check.fly(20.0, 0.0, 0.0))  # hovering shows nothing
    assert check.fly(1.0, 0.6, -0.6)[-1]  # climbing with the filter does


def test_consistency_needs_vertical_motion_and_a_second():
    check = Consistency()
    check.fly(0.1, 0.0, 0.0)
    check.rng["is_kinematically_consistent"] = False
    check.rng["kin_time_last_inconsistent"] = check.time_us
    verdicts = check.fly(1.5, 0.6, -0.6)
    assert verdicts.index(True) == 20  # 1.05 s: more than a second
    check.rng["is_kinematically_consistent"] = False
    assert not any(check.fly(3.0, 0.4, -0.4))  # slower than 0.5 m/s


def test_horizontal_motion_suspends_the_verdict():
    check = Consistency()
    check.fly(1.0, 0.0, 0.0)
    assert all(check.fly(5.0, 6.0, 0.0, horizontal_motion=True))
    assert not check.fly(0.05, 6.0, 0.0, horizontal_motion=False)[0]


def test_main_suspends_it_for_two_seconds_more():
    check = Consistency(MOTION_HOLD)
    check.fly(1.0, 0.0, 0.0)
    check.fly(5.0, 6.0, 0.0, horizontal_motion=True)
    verdicts = check.fly(3.0, 6.0, 0.0, horizontal_motion=False)
    assert verdicts.index(False) * PERIOD_US == pytest.approx(2_000_000, abs=PERIOD_US)


def test_a_gap_restarts_the_difference():
    check = Consistency()
    check.fly(0.5, 0.0, 0.0)
    before = check.rng["kin_innovation"]
    check.time_us += 600_000
    check.distance += 10.0
    check.fly(0.05, 0.0, 0.0)
    assert check.rng["kin_innovation"] == before
