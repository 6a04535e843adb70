"""Magnetometer and barometer between the samples of a thinned log, and telling them from measured ones."""

import numpy as np
import pytest

from fusetune.analyze.reconstruction import ReconstructionSettings, measured_rows, reconstruct
from fusetune.analyze.reconstruction.attitude import attitude_history, steady_history, to_body
from fusetune.analyze.reconstruction.between_samples import sensor_rate_hz
from fusetune.analyze.reconstruction.magnetometer import _spline_is_nearer, interpolate_magnetometer
from fusetune.analyze.replaying.prepared_flight import PreparedFlight, prepare
from fusetune.analyze.replaying.replay_flight import write_replay
from fusetune.analyze.replaying.store.reader import read_set
from fusetune.analyze.trust.fidelity import load_innovations
from fusetune.px4.flight import Flight, select_rows
from fusetune.px4.parameters.complete_sets import complete
from fusetune.quaternions import conjugate, from_rotation_vector, multiply, rotation_vector

EARTH = np.array([0.21, 0.03, 0.43])
BODY = np.array([0.05, -0.03, 0.02])


def turning_vehicle(rows=8000):
    """Attitude of a vehicle that yaws at 0.5 rad/s, tilted by 0.3 rad, and its gyro at 200 Hz."""
    time = 1_000_000 + 5_000 * np.arange(1, rows + 1)
    yaw = 0.5 * 0.005 * np.arange(1, rows + 1)
    tilt = from_rotation_vector(np.tile([0.3, 0.0, 0.0], (rows, 1)))
    turn = from_rotation_vector(np.stack([0 * yaw, 0 * yaw, yaw], axis=1))
    w, x, y, z = turn.T
    a, b, c, d = tilt.T
    q = np.stack(
        [w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c, w * c - x * d + y * a + z * b,
         w * d + x * c - y * b + z * a], axis=1
    )  # fmt: skip
    rate = to_body(q, np.tile([0.0, 0.0, 0.5], (rows, 1)))
    imu = {"timestamp": time, "gyro_integral_dt": np.full(rows, 5_000, np.uint32)}
    imu |= {f"gyro_rad[{i}]": rate[:, i] for i in range(3)}
    return imu, q


def magnetometer(time, q, latency=3_000):
    field = to_body(q, np.tile(EARTH, (len(time), 1))) + BODY
    table = {"timestamp": time + latency, "timestamp_sample": time, "device_id": np.full(len(time), 7, np.uint32)}
    return table | {f"magnetometer_ga[{i}]": field[:, i] for i in range(3)}


def test_field_of_a_turning_vehicle_is_exact_between_samples():
    imu, q = turning_vehicle()
    attitude = {"timestamp": imu["timestamp"][::10], "timestamp_sample": imu["timestamp"][::10]}
    attitude |= {f"q[{i}]": q[::10, i] for i in range(4)}
    history = attitude_history(attitude, imu)
    whole = magnetometer(imu["timestamp"][::4], q[::4])
    thin = select_rows(whole, np.arange(0, len(whole["timestamp"]), 25))
    table, measured = interpolate_magnetometer(thin, history, 50.0, 2.0)
    assert measured.sum() == len(thin["timestamp"])
    rows = np.searchsorted(whole["timestamp_sample"], table["timestamp_sample"])
    np.testing.assert_array_equal(whole["timestamp_sample"][rows], table["timestamp_sample"])
    for axis in range(3):
        name = f"magnetometer_ga[{axis}]"
        np.testing.assert_allclose(table[name], whole[name][rows], atol=2e-5)
    np.testing.assert_array_equal(table["timestamp"] - table["timestamp_sample"], 3_000)


def logged(imu, q, heading):
    """Attitude at 20 Hz, turned about the vertical by `heading` (N,), rad."""
    up = np.zeros((len(heading), 3))
    up[:, 2] = heading
    turned = multiply(from_rotation_vector(up), q)[::10]
    times = imu["timestamp"][::10]
    return {"timestamp": times, "timestamp_sample": times} | {f"q[{i}]": turned[:, i] for i in range(4)}


def test_field_stays_exact_when_the_heading_is_reset_in_flight():
    """A reset by 1 rad moves the field in the vehicle's NED frame by 0.2 Gauss, and nothing in the body."""
    imu, q = turning_vehicle()
    heading = np.where(np.arange(len(q)) < 4037, 0.0, 1.0)
    history = steady_history(logged(imu, q, heading), imu)
    whole = magnetometer(imu["timestamp"][::4], q[::4])
    thin = select_rows(whole, np.arange(0, len(whole["timestamp"]), 25))
    table, _ = interpolate_magnetometer(thin, history, 50.0, 2.0)
    rows = np.searchsorted(whole["timestamp_sample"], table["timestamp_sample"])
    for axis in range(3):
        name = f"magnetometer_ga[{axis}]"
        np.testing.assert_allclose(table[name], whole[name][rows], atol=1e-4)


def test_smooth_field_is_followed_between_samples_and_noise_is_not():
    """A parabola, sampled twice a second: the line misses it by up to a quarter of its curvature, the cubic by none."""
    samples = np.arange(40)
    smooth = np.stack([0.01 * samples**2, 0.0 * samples, 0.2 * samples], axis=1)
    assert _spline_is_nearer(smooth)
    assert not _spline_is_nearer(np.random.default_rng(6).standard_normal((400, 3)))


def test_steady_attitude_has_the_drift_of_the_gyro_taken_off():
    """A gyro that reads 0.01 rad/s too much, over 40 s; the logged heading jitters by 0.02 rad."""
    imu, q = turning_vehicle()
    biased = dict(imu) | {f"gyro_rad[{i}]": imu[f"gyro_rad[{i}]"] + 0.01 for i in range(3)}
    jitter = np.repeat(0.02 * np.random.default_rng(4).standard_normal(len(q) // 40), 40)
    history = steady_history(logged(imu, q, jitter), biased)
    error = rotation_vector(
        multiply(conjugate(multiply(history.q, conjugate(q)))[:1], multiply(history.q, conjugate(q)))
    )
    # left to itself the gyro would be wrong by 0.7 rad; neighbouring attitudes differ by 0.03 rad
    assert np.linalg.norm(error, axis=1).max() < 0.06
    assert np.linalg.norm(np.diff(error, axis=0), axis=1).max() < 2e-5


def test_attitude_is_followed_where_imu_rows_are_missing():
    imu, q = turning_vehicle()
    kept = np.r_[0:3000, 3400 : len(q)]
    history = steady_history(logged(imu, q, np.zeros(len(q))), select_rows(imu, kept))
    error = rotation_vector(multiply(conjugate(q[kept]), history.q))
    assert np.linalg.norm(error, axis=1).max() < 0.03


def test_without_attitude_nothing_is_interpolated():
    imu, q = turning_vehicle(2000)
    thin = magnetometer(imu["timestamp"][::100], q[::100])
    table, measured = interpolate_magnetometer(thin, attitude_history(None, imu), 50.0, 2.0)
    assert measured.all()
    assert len(table["timestamp"]) == len(thin["timestamp"])


@pytest.fixture(scope="module")
def flight(survey_flight) -> Flight:
    return survey_flight


def thinned(flight: Flight) -> Flight:
    """Magnetometer 2 Hz, barometer 5 Hz, three IMU rows in a hundred lost."""
    topics = {key: table for key, table in flight.topics.items() if key[0] != "ekf2_timestamps"}
    for name, hertz in (("vehicle_magnetometer", 2.0), ("vehicle_air_data", 5.0)):
        table = topics[name, 0]
        step = round(1e6 / hertz / float(np.median(np.diff(table["timestamp"].astype(np.int64)))))
        topics[name, 0] = select_rows(table, np.arange(0, len(table["timestamp"]), step))
    imu = topics["sensor_combined", 0]
    rows = np.arange(len(imu["timestamp"]))
    topics["sensor_combined", 0] = select_rows(imu, rows % 100 > 2)
    return flight.with_topics(topics)


@pytest.fixture(scope="module")
def small(flight) -> Flight:
    return thinned(flight)


@pytest.fixture(scope="module")
def mended(small) -> PreparedFlight:
    return prepare(small, ReconstructionSettings())


def test_whole_log_passes_through_as_it_is(flight):
    result = reconstruct(flight)
    assert not result.changed
    for key, table in flight.topics.items():
        assert result.flight.topics[key] is table
    assert [step.done for step in result.steps] == [False, False, False]


def test_every_step_can_be_switched_off(flight):
    off = ReconstructionSettings(imu=False, magnetometer=False, barometer=False)
    small = thinned(flight)
    result = reconstruct(small, off)
    assert not result.changed
    assert [step.what for step in result.steps] == ["switched off"] * 3


def test_steps_are_recorded_with_their_samples(flight, small, mended):
    result = mended.reconstructed
    for step in result.steps:
        assert step.done
        assert step.measured == len(small.topics[step.sensor, 0]["timestamp"])
        assert step.measured + step.added == len(result.flight.topics[step.sensor, 0]["timestamp"])
    assert len(result.flight.topics["vehicle_gps_position", 0]["timestamp"]) == len(
        flight.topics["vehicle_gps_position", 0]["timestamp"]
    )


def test_sparse_imu_is_not_made_up(flight):
    imu = flight.topics["sensor_combined", 0]
    tenth = select_rows(imu, np.arange(0, len(imu["timestamp"]), 10))
    result = reconstruct(flight.with_topics(flight.topics | {("sensor_combined", 0): tenth}))
    assert "too many" in result.steps[0].what
    assert result.flight.topics["sensor_combined", 0] is tenth


def test_only_measured_samples_are_scored(small, mended, tmp_path):
    params = complete(small.parameters.initial, {}, small.release)
    result, measured = mended.replay(params)
    for source, topic in (("mag", "vehicle_magnetometer"), ("baro_hgt", "vehicle_air_data")):
        of_source = result.source_names() == source
        axis = of_source & (result.innovations["axis"] == 0)
        logged = len(small.topics[topic, 0]["timestamp"])
        # a few samples at either end arrive before the filter starts or after its horizon stops
        assert logged - 12 <= measured[axis].sum() <= logged
        assert axis.sum() > 3 * logged
    assert measured[result.source_names() == "gnss_vel"].all()
    write_replay(mended, "s", {}, tmp_path)
    record = read_set(tmp_path, "s")
    mag = (result.source_names() == "mag") & (result.innovations["axis"] == 0) & measured
    assert len(record.samples["mag", 0].innovation) == mag.sum()
    rows = load_innovations(tmp_path / "s.innovations.parquet")
    assert len(rows.axis) == measured.sum()
    assert record.summary["reconstruction"][0]["added"] > 0


def test_reconstruction_brings_the_replay_back(flight, small, mended):
    """Velocity innovations of the thinned log: far from the whole log's as it is, near after reconstruction."""
    params = complete(flight.parameters.initial, {}, flight.release)

    def velocity(prepared):
        result, _ = prepared.replay(params)
        rows = result.innovations[(result.source_names() == "gnss_vel") & (result.innovations["axis"] < 2)]
        return rows[rows["timestamp_sample"] > rows["timestamp_sample"][0] + 30_000_000]

    whole, raw, near = (velocity(one) for one in (prepare(flight), prepare(small), mended))

    def difference(other):
        _, left, right = np.intersect1d(whole["timestamp_sample"], other["timestamp_sample"], return_indices=True)
        a, b = whole["innovation"][left], other["innovation"][right]
        return np.sqrt(np.mean((a - b) ** 2) / np.mean(a**2))

    assert difference(near) < 0.1
    assert difference(raw) > 10 * difference(near)


def test_rows_without_reconstruction_are_all_measured(flight):
    prepared = prepare(flight)
    rows = np.zeros(3, [("source", "i4"), ("timestamp_sample", "i8")])
    assert measured_rows(rows, prepared.reconstructed, {}, 10_000.0).all()


def test_rate_of_the_sensor_is_read_from_the_times_of_the_samples_that_are_left():
    """A sensor at 13.3 Hz, of which a logger keeps the first sample after every 450 ms: 6 intervals, or 7."""
    interval_us = 1e6 / 13.3
    kept, last = [], -1e9
    for time in np.round(1_000_000 + interval_us * np.arange(2000)):
        if time - last >= 450_000 + (len(kept) % 2) * 60_000:
            kept.append(int(time))
            last = time
    table = {"timestamp": np.array(kept), "timestamp_sample": np.array(kept)}
    assert sensor_rate_hz(table, 15.0) == pytest.approx(13.3, abs=0.05)


def test_rate_without_a_grid_is_the_nominal_one():
    random = np.random.default_rng(3)
    times = np.cumsum(random.integers(400_000, 600_000, 200))
    assert sensor_rate_hz({"timestamp": times, "timestamp_sample": times}, 50.0) == 50.0


def test_attitude_does_not_depend_on_how_many_rows_are_taken_at_once(survey_flight, monkeypatch):
    imu = select_rows(survey_flight.topics["sensor_combined", 0], np.arange(5000, 8000))
    logged = survey_flight.topics["vehicle_attitude", 0]
    whole = attitude_history(logged, imu), steady_history(logged, imu)
    monkeypatch.setattr("fusetune.analyze.reconstruction.attitude.ROWS_AT_ONCE", 700)
    parts = attitude_history(logged, imu), steady_history(logged, imu)
    for one, other in zip(whole, parts, strict=True):
        assert len(one.q) == 3000
        np.testing.assert_array_equal(one.q, other.q)
        np.testing.assert_array_equal(one.known, other.known)
