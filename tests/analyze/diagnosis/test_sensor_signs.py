"""Signs of single sensors on made readings: IMU at rest, GNSS jumps, range finder, airspeed."""

from dataclasses import replace

import numpy as np
import pytest
from tests.analyze.diagnosis.made_motion import FLYING, made_motion, true_rotation

from fusetune.analyze.diagnosis.airspeed_signs import airspeed_signs
from fusetune.analyze.diagnosis.beam_signs import RangeSigns, range_signs
from fusetune.analyze.diagnosis.gnss_signs import GnssSigns, gnss_signs
from fusetune.analyze.diagnosis.imu_signs import gyro_bias, imu_signs
from fusetune.analyze.diagnosis.motion import Motion
from fusetune.ekf2.numerics.constants import ONE_G, RADIUS_OF_EARTH
from fusetune.px4.flight import Flight, TopicTable

MOTION = made_motion()


def imu(bias_deg_s: float = 0.0, shake: float = 0.0) -> Flight:
    """A hundred samples a second; a gyro's bias, and noise in the air that changes by `shake` from one to the next."""
    rng = np.random.default_rng(1)
    flying = (MOTION.time >= FLYING[0][0]) & (MOTION.time < FLYING[0][1])
    force = MOTION.force + flying[:, None] * shake / np.sqrt(3.0) * rng.normal(size=MOTION.force.shape)
    rate = MOTION.body_rate + np.radians([0.0, bias_deg_s, 0.0]) + 1e-4 * rng.normal(size=force.shape)
    table: TopicTable = {"timestamp": MOTION.time}
    table |= {f"accelerometer_m_s2[{axis}]": force[:, axis] for axis in range(3)}
    table |= {f"gyro_rad[{axis}]": rate[:, axis] for axis in range(3)}
    return Flight("made", {("sensor_combined", 0): table})


def test_shaking_is_the_white_part_of_the_noise() -> None:
    calm, shaken = (imu_signs(imu(shake=one), FLYING) for one in (0.0, 6.0))
    assert calm is not None
    assert shaken is not None
    assert shaken.shaking**2 - calm.shaking**2 == pytest.approx(36.0, rel=0.05)
    assert shaken.resting_force == pytest.approx(ONE_G, abs=0.01)


def test_the_bias_at_rest_is_read_directly() -> None:
    one = gyro_bias(imu(5.0), None, FLYING)
    assert one is not None
    assert np.degrees(one.at_rest) == pytest.approx([0.0, 5.0, 0.0], abs=0.02)
    assert np.degrees(one.change).max() < 0.1


def test_a_steady_bank_on_the_ground_is_no_bias() -> None:
    # a wing that rolls at 4 °/s for two seconds before it is called airborne: gyros alone take it for rest
    flight = imu(0.3)
    table = flight.topics["sensor_combined", 0]
    still = np.arange(1000, dtype=np.int64)
    for name, values in table.items():
        table[name] = np.concatenate([values[still % 300], values])
    table["timestamp"][:1000] = MOTION.time[0] - 10_000 * (1000 - still)
    time = table["timestamp"]
    rolls = (time >= FLYING[0][0] - 4_000_000) & (time < FLYING[0][0] - 2_000_000)
    since_s = (time[rolls] - time[rolls][0]) * 1e-6
    roll = np.radians(4.0) * since_s
    table["gyro_rad[0]"][rolls] += np.radians(4.0)
    table["accelerometer_m_s2[1]"][rolls] -= ONE_G * np.sin(roll)
    table["accelerometer_m_s2[2]"][rolls] = -ONE_G * np.cos(roll)
    one = gyro_bias(flight, None, FLYING)
    assert one is not None
    assert np.degrees(one.at_rest) == pytest.approx([0.0, 0.3, 0.0], abs=0.05)
    assert np.degrees(one.change).max() < 0.3


def test_a_clock_that_steps_back_or_jumps_ends_no_sign_of_the_imu() -> None:
    flight = imu(5.0)
    time = flight.topics["sensor_combined", 0]["timestamp"] = MOTION.time.copy()
    time[100:200] -= 3_000_000
    time[50] = 10**16
    one, bias = imu_signs(flight, FLYING), gyro_bias(flight, None, FLYING)
    assert one is not None
    assert bias is not None
    assert one.resting_force == pytest.approx(ONE_G, abs=0.01)
    assert np.degrees(bias.at_rest) == pytest.approx([0.0, 5.0, 0.0], abs=0.02)


def test_missing_samples_are_gaps_and_a_share() -> None:
    flight = imu()
    table = flight.topics["sensor_combined", 0]
    keep = np.ones(MOTION.time.size, bool)
    keep[2000:2030] = keep[3000:3002] = False
    flight.topics["sensor_combined", 0] = {name: values[keep] for name, values in table.items()}
    one = imu_signs(flight, FLYING)
    assert one is not None
    # thirty samples are 0.3 s, and the step over them is one longer; two are no long gap
    assert len(one.gaps) == 1
    assert one.lost_s == pytest.approx(0.31)
    assert one.lost_share == pytest.approx(0.32 / 60.0, rel=0.02)


def gnss(motion: Motion | None = None, **changed: np.ndarray) -> GnssSigns:
    time = np.arange(FLYING[0][0] - 2_000_000, FLYING[0][1], 200_000, dtype=np.int64)
    velocity = MOTION.at(time, MOTION.velocity)
    step_s = np.diff(time, prepend=time[:1]) * 1e-6
    place = np.cumsum(velocity * step_s[:, None], axis=0) + changed.pop("place", np.zeros((time.size, 3)))
    place = place + 0.03 * np.random.default_rng(5).normal(size=place.shape)
    table: TopicTable = {
        "timestamp": time, "fix_type": np.full(time.size, 3), "satellites_used": np.full(time.size, 15),
        "latitude_deg": np.degrees(place[:, 0] / RADIUS_OF_EARTH),
        "longitude_deg": np.degrees(place[:, 1] / RADIUS_OF_EARTH),
        "eph": np.full(time.size, 0.8), "epv": np.full(time.size, 1.2), "s_variance_m_s": np.full(time.size, 0.2),
        **{f"vel_{axis}_m_s": velocity[:, i] for i, axis in enumerate("ned")},
    }  # fmt: skip
    one = gnss_signs(table | changed, FLYING, motion)
    assert one is not None
    return one


COUNT = int((FLYING[0][1] - FLYING[0][0] + 2_000_000) / 200_000)


def test_a_sound_receiver_neither_jumps_nor_is_lost() -> None:
    one = gnss()
    assert (one.jumps, one.lost, one.poor, one.jammed) == ((), (), None, None)


def test_a_fix_without_a_position_is_none() -> None:
    one = gnss(latitude_deg=np.full(COUNT, np.nan), longitude_deg=np.full(COUNT, np.nan))
    assert not one.ever_fixed
    assert one.samples > 250


def test_a_jump_is_seen_where_it_begins_and_ends() -> None:
    place = np.zeros((COUNT, 3))
    place[100:140, 0] = 9.0
    one = gnss(place=place)
    assert [jump.size for jump in one.jumps] == pytest.approx([9.0, 9.0], abs=0.7)
    assert one.jumps[1].time - one.jumps[0].time == 40 * 200_000


def test_a_stop_that_the_imu_feels_is_no_jump_of_the_velocity() -> None:
    time = np.arange(FLYING[0][0] - 2_000_000, FLYING[0][1], 200_000, dtype=np.int64)
    stops = FLYING[0][0] + 31_000_000
    velocity = MOTION.at(time, MOTION.velocity)
    velocity[time >= stops, 0] += 7.0
    moved = np.cumsum(velocity * np.diff(time, prepend=time[:1])[:, None] * 1e-6, axis=0)
    changed = {"vel_n_m_s": velocity[:, 0], "place": moved - np.cumsum(
        MOTION.at(time, MOTION.velocity) * np.diff(time, prepend=time[:1])[:, None] * 1e-6, axis=0
    )}  # fmt: skip
    felt = MOTION.free_velocity + 7.0 * (MOTION.time >= stops - 100_000)[:, None] * np.array([0.6, 0.8, 0.0])
    assert [one.of_velocity for one in gnss(motion=MOTION, **changed).jumps] == [True]
    assert gnss(motion=replace(MOTION, free_velocity=felt), **changed).jumps == ()


def test_a_jump_of_a_receiver_that_says_that_it_is_poor_is_none() -> None:
    place, eph = np.zeros((COUNT, 3)), np.full(COUNT, 0.8)
    place[100:140, 0], eph[99:141] = 9.0, 8.0
    one = gnss(place=place, eph=eph)
    assert one.jumps == ()
    assert one.poor is not None


def test_a_lost_fix_is_as_long_as_it_was() -> None:
    fix = np.full(COUNT, 3)
    fix[150:180] = 1
    ((start, stop),) = gnss(fix_type=fix).lost
    assert (stop - start) * 1e-6 == pytest.approx(30 * 0.2 + 0.2)


def beam(change: np.ndarray | float = 0.0, only: tuple[int, int] | None = None) -> RangeSigns:
    time = np.arange(FLYING[0][0], FLYING[0][1], 50_000, dtype=np.int64)
    distance = MOTION.at(time, MOTION.height) / MOTION.at(time, MOTION.rotation)[:, 2, 2]
    distance = distance + 0.02 * np.random.default_rng(7).normal(size=time.size) + change
    if only is not None:
        distance[only[0] : only[1]] = 0.35
    table: TopicTable = {
        "timestamp": time, "current_distance": distance, "min_distance": np.full(time.size, 0.1),
        "max_distance": np.full(time.size, 40.0), "orientation": np.full(time.size, 25),
        "signal_quality": np.full(time.size, 100),
    }  # fmt: skip
    one = range_signs(Flight("made", {("distance_sensor", 0): table}), MOTION, FLYING)
    assert one is not None
    return one


def test_steps_below_are_found_with_their_height_and_none_else() -> None:
    steps = np.zeros(1200)
    steps[400:450] = -0.8
    one = beam(steps)
    assert [size for _, size in one.steps] == pytest.approx([-0.8, 0.8], abs=0.1)
    assert one.short_share < 0.01
    assert beam().steps == ()


def test_something_in_the_beam_reads_the_same_whatever_the_height() -> None:
    one = beam(only=(300, 600))
    assert one.short_share == pytest.approx(0.25, abs=0.05)
    assert one.constant_share == 1.0
    assert one.short_m == pytest.approx(0.35)


@pytest.mark.parametrize("scale", [0.7, 1.0, 1.4])
def test_airspeed_is_held_against_velocity_and_one_wind(scale: float) -> None:
    wind = np.array([1.5, -2.0, 0.0])
    time = np.arange(FLYING[0][0], FLYING[0][1], 100_000, dtype=np.int64)
    through = MOTION.at(time, np.einsum("nji,nj->ni", true_rotation(MOTION), MOTION.velocity - wind))[:, 0]
    reading = scale * through + 0.1 * np.random.default_rng(9).normal(size=time.size)
    table: TopicTable = {"timestamp": time, "true_airspeed_m_s": reading, "indicated_airspeed_m_s": reading}
    one = airspeed_signs(Flight("made", {("airspeed", 0): table}), MOTION, FLYING)
    assert one is not None
    assert one.scale == pytest.approx(scale, abs=max(0.05, 3.0 * one.error))
