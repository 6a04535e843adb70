"""Filled IMU rows: time, integrals and what is left alone; expected values by hand."""

import numpy as np
import pytest

from fusetune.analyze.reconstruction.gap_values import fill_missing, solved_without
from fusetune.analyze.reconstruction.gyro_by_attitude import correct_gyro
from fusetune.analyze.reconstruction.imu_gaps import fill_imu_gaps, find_imu_gaps
from fusetune.analyze.reconstruction.trial_gaps import try_gaps, variance_per_second
from fusetune.px4.flight import select_rows
from fusetune.quaternions import from_rotation_vector, multiply

INTERVAL_US = 5_000


def imu(rate, force, jitter=0):
    """`sensor_combined` of rates and forces (N, 3) at 200 Hz."""
    rows = len(rate)
    table = {f"gyro_rad[{i}]": rate[:, i].astype(np.float32) for i in range(3)}
    table |= {f"accelerometer_m_s2[{i}]": force[:, i].astype(np.float32) for i in range(3)}
    stamps = 1_000_000 + INTERVAL_US * np.arange(1, rows + 1)
    return {
        "timestamp": stamps + np.random.default_rng(0).integers(-jitter, jitter + 1, rows),
        "gyro_integral_dt": np.full(rows, INTERVAL_US, np.uint32),
        "accelerometer_integral_dt": np.full(rows, INTERVAL_US, np.uint32),
        "accelerometer_clipping": np.ones(rows, np.uint8),
        **table,
    }


def without(table, missing):
    return select_rows(table, np.setdiff1d(np.arange(len(table["timestamp"])), missing))


def manoeuvre(rows):
    """Rates and forces of a vehicle that swings slowly: 0.3 Hz."""
    phase = 2 * np.pi * 0.3 * np.arange(rows) * INTERVAL_US * 1e-6
    rate = np.stack([0.5 * np.sin(phase), 0.4 * np.cos(phase), 0.2 * np.sin(phase + 1)], axis=1)
    return rate, np.stack([np.sin(phase), np.cos(phase), -9.8 + 0.5 * np.sin(phase)], axis=1)


def test_gap_is_where_windows_do_not_meet():
    gaps = find_imu_gaps(without(imu(*manoeuvre(100)), [20, 21, 22, 60]))
    assert gaps.row.tolist() == [20, 57]
    assert gaps.missing.tolist() == [3, 1]
    assert gaps.length_us.tolist() == [3 * INTERVAL_US, INTERVAL_US]


def test_whole_table_is_handed_on_as_it_is():
    table = imu(*manoeuvre(200), jitter=1000)
    filled, measured = fill_imu_gaps(table, 0.2)
    assert filled is table
    assert measured.all()


def test_filling_gives_back_time_rows_and_integrals():
    whole = imu(*manoeuvre(2000))
    missing = np.concatenate([np.arange(start, start + 1 + start % 4) for start in range(100, 1900, 50)])
    filled, measured = fill_imu_gaps(without(whole, missing), 0.2)
    np.testing.assert_array_equal(filled["timestamp"], whole["timestamp"])
    np.testing.assert_array_equal(np.flatnonzero(~measured), missing)
    assert filled["gyro_integral_dt"].sum() == whole["gyro_integral_dt"].sum()
    for axis in range(3):
        for name in (f"gyro_rad[{axis}]", f"accelerometer_m_s2[{axis}]"):
            # the line between neighbours misses a sine by at most ⅛ (ω T)² of its amplitude, here 3e-4
            np.testing.assert_allclose(filled[name], whole[name], atol=1e-3)
            np.testing.assert_array_equal(filled[name][measured], whole[name][measured])
    assert not filled["accelerometer_clipping"][~measured].any()


def test_long_gap_stays_open():
    table = without(imu(*manoeuvre(400)), np.arange(100, 150))
    filled, measured = fill_imu_gaps(table, 0.2)
    assert filled is table
    assert measured.all()


def test_vibration_that_keeps_its_phase_is_carried_into_the_gap():
    """A line between neighbours would give nearly zero: half a period of 80 Hz is shorter than the gap."""
    time = np.arange(4000) * 0.005
    random = np.random.default_rng(1)
    signal = np.sin(2 * np.pi * 80.0 * time) + 0.05 * random.standard_normal(len(time))
    first = np.arange(100, 3900, 40)
    count = np.full(len(first), 3)
    rows = (first[:, None] + np.arange(3)).ravel()
    present = np.ones(len(time), bool)
    present[rows] = False
    error = fill_missing(np.where(present, signal, 0.0), present, first, count) - signal[rows]
    # white noise of 0.05 cannot be foreseen, and is what remains
    assert np.sqrt(np.mean(error**2)) < 0.1


def test_white_noise_is_filled_with_its_mean():
    random = np.random.default_rng(2)
    signal = 3.0 + random.standard_normal(4000)
    first, count = np.arange(100, 3900, 40), np.full(95, 2)
    rows = (first[:, None] + np.arange(2)).ravel()
    present = np.ones(len(signal), bool)
    present[rows] = False
    filled = fill_missing(signal, present, first, count)
    assert np.abs(filled.mean() - 3.0) < 0.1
    assert filled.std() < 0.35


def test_logged_attitude_tells_what_was_turned_in_a_gap():
    """A pulse of 1 rad/s lies wholly in each gap: no neighbour shows it, the attitude does.

    There are as many pulses after the gaps, which tell that lines over gaps cannot be relied on here.
    """
    rows = 4000
    rate = np.zeros((rows, 3))
    pulses = np.arange(205, 3800, 200)
    for start in pulses:
        rate[start : start + 2, 0] = rate[start + 7 : start + 9, 0] = 1.0
    whole = imu(rate, np.tile([0.0, 0.0, -9.8], (rows, 1)))
    turned = from_rotation_vector(np.cumsum(rate * 0.005, axis=0))
    attitude = {"timestamp": whole["timestamp"][9::10], "timestamp_sample": whole["timestamp"][9::10]}
    attitude |= {f"q[{i}]": turned[9::10, i] for i in range(4)}
    missing = np.concatenate([np.arange(start, start + 2) for start in pulses])
    filled, measured = fill_imu_gaps(without(whole, missing), 0.2)
    assert np.abs(filled["gyro_rad[0]"][missing]).max() < 0.1
    corrected = correct_gyro(filled, measured, attitude)
    turned_in_gaps = corrected["gyro_rad[0]"][missing].reshape(-1, 2).mean(axis=1)
    np.testing.assert_allclose(turned_in_gaps, 1.0, atol=0.02)
    np.testing.assert_array_equal(corrected["gyro_rad[0]"][measured], whole["gyro_rad[0]"][measured])


def test_corrections_of_the_filter_are_not_taken_for_motion():
    """The vehicle does not turn at all; its attitude is corrected by 5 mrad either way, at random, all the time."""
    rows = 4000
    random = np.random.default_rng(8)
    noise = 0.01 * random.standard_normal((rows, 3))
    whole = imu(noise, np.tile([0.0, 0.0, -9.8], (rows, 1)))
    corrections = np.repeat(0.005 * random.standard_normal((rows // 10, 3)), 10, axis=0)
    logged = from_rotation_vector(corrections)
    attitude = {"timestamp": whole["timestamp"][9::10], "timestamp_sample": whole["timestamp"][9::10]}
    attitude |= {f"q[{i}]": logged[9::10, i] for i in range(4)}
    missing = np.concatenate([np.arange(start, start + 2) for start in range(205, 3800, 50)])
    filled, measured = fill_imu_gaps(without(whole, missing), 0.2)
    corrected = correct_gyro(filled, measured, attitude)
    for axis in range(3):
        change = corrected[f"gyro_rad[{axis}]"][missing] - filled[f"gyro_rad[{axis}]"][missing]
        # believed, a correction of 5 mrad over two rows would be 0.7 rad/s
        assert np.abs(change).max() < 0.005


def test_variance_of_filled_white_noise_is_the_noise_of_its_integral():
    """n rows of variance s², each lasting t, filled by their mean: n s² t² over n t seconds."""
    rows, sigma = 8000, 0.3
    noise = sigma * np.random.default_rng(9).standard_normal((rows, 3))
    whole = imu(noise, np.tile([0.0, 0.0, -9.8], (rows, 1)))
    missing = np.concatenate([np.arange(start, start + 2) for start in range(105, 7800, 40)])
    filled, measured = fill_imu_gaps(without(whole, missing), 0.2)
    trials = try_gaps(filled, measured, "gyro_rad", "gyro_integral_dt")
    np.testing.assert_allclose(trials.duration_s, 2 * INTERVAL_US * 1e-6)
    expected = sigma**2 * INTERVAL_US * 1e-6
    # 193 trials: a variance estimated from them scatters by sqrt(2 / 193) = 10 %
    np.testing.assert_allclose(variance_per_second(trials, trials.error), expected, rtol=0.35)


def test_attitude_without_gaps_changes_nothing():
    table = imu(*manoeuvre(300))
    assert correct_gyro(table, np.ones(300, bool), None) is table


@pytest.mark.parametrize("seed", range(5))
def test_quaternion_product_of_rotation_vectors_about_one_axis_adds_them(seed):
    axis = np.random.default_rng(seed).standard_normal(3)
    axis /= np.linalg.norm(axis)
    product = multiply(from_rotation_vector(0.3 * axis), from_rotation_vector(0.5 * axis))
    np.testing.assert_allclose(product, from_rotation_vector(0.8 * axis), atol=1e-15)


def test_equations_of_which_some_are_lacking_are_solved_as_if_they_had_never_been():
    """Against NumPy's solution of each block that is left."""
    chance = np.random.default_rng(1)
    root = chance.normal(size=(12, 12))
    matrix = root @ root.T + np.eye(12)
    lacking = chance.random((40, 12)) < 0.3
    values = np.where(lacking, 0.0, chance.normal(size=(40, 12)))
    for row, gone, found in zip(values, lacking, solved_without(matrix, values, lacking), strict=True):
        expected = np.linalg.solve(matrix[np.ix_(~gone, ~gone)], row[~gone])
        np.testing.assert_allclose(found[~gone], expected, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(found[gone], 0.0, atol=1e-12)
