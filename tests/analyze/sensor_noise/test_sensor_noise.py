from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from tests.analyze.sensor_noise.made_sensors import ACCEL, AIRBORNE, BARO, GYRO, MAG, made_flight, made_topics

from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.sensor_noise.pooled import pooled_sensors
from fusetune.analyze.sensor_noise.sensor_noise import (
    SensorNoise,
    sensor_noise,
    write_sensor_noise,
)
from fusetune.analyze.sensor_noise.starting_noises import StartingNoise, per_update
from fusetune.errors import UserError
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.save.flight_folder import write_flight
from fusetune.storage.documents import read_document


@pytest.fixture(scope="module")
def noise() -> SensorNoise:
    return sensor_noise(made_flight(made_topics(np.random.default_rng(1))), AIRBORNE)


def starting(noise: SensorNoise) -> dict[str, StartingNoise]:
    return {one.parameter: one for one in noise.starting}


def test_noise_density_of_each_sensor_is_that_of_its_samples(noise: SensorNoise) -> None:
    # white noise of σ at rate f has the density σ / √f
    for name, size, rate in (("gyro", GYRO, 200.0), ("accel", ACCEL, 200.0), ("mag", MAG, 50.0), ("baro", BARO, 20.0)):
        figure = noise.sensors[name].figures.noise_density
        assert figure.value == pytest.approx(size / math.sqrt(rate), rel=0.06), name
        assert figure.low < figure.value < figure.high
        assert "stands still for only" in noise.sensors[name].figures.random_walk.refusal


def test_vibration_limits_the_imu_and_not_the_magnetometer(noise: SensorNoise) -> None:
    assert noise.vibration_limited == ("gyro", "accel")
    vibration = noise.sensors["gyro"].vibration
    assert vibration is not None
    assert vibration.ratio == pytest.approx(5.0, rel=0.05)
    assert noise.sensors["mag"].vibration is not None
    assert noise.sensors["mag"].vibration.ratio == pytest.approx(1.0, rel=0.05)


def test_imu_parameters_are_the_density_over_the_root_of_an_update(noise: SensorNoise) -> None:
    # an update of 10 ms is the mean of two samples of 200 Hz: σ / √2
    gyro, accel = starting(noise)["EKF2_GYR_NOISE"], starting(noise)["EKF2_ACC_NOISE"]
    assert gyro.at_rest == pytest.approx(GYRO / math.sqrt(2.0), rel=0.03)
    assert gyro.in_flight == pytest.approx(5.0 * GYRO / math.sqrt(2.0), rel=0.03)
    assert gyro.start_with == pytest.approx(0.015)
    assert "times the noise that is there" in gyro.words
    assert accel.in_flight == pytest.approx(5.0 * ACCEL / math.sqrt(2.0), rel=0.03)


def test_too_little_noise_is_raised_to_what_the_flight_asks_for() -> None:
    found = starting(sensor_noise(made_flight(made_topics(np.random.default_rng(2), in_flight=40.0)), AIRBORNE))
    accel = found["EKF2_ACC_NOISE"]
    assert accel.in_flight == pytest.approx(40.0 * ACCEL / math.sqrt(2.0), rel=0.03)
    assert accel.start_with == pytest.approx(accel.in_flight, rel=0.01)
    assert "less than the noise that is there" in accel.words
    # 0.0566 rad/s is within PX4's limit of 0.1
    assert found["EKF2_GYR_NOISE"].start_with == pytest.approx(0.057, rel=0.03)


def test_a_parameter_adds_up_over_updates_as_the_noise_does() -> None:
    """(p Δt)² per update of 8 ms over a second is N², the variance that white noise of density N adds in it."""
    parameter = per_update(0.003, 0.008)
    assert 125 * (parameter * 0.008) ** 2 == pytest.approx(0.003**2)


def test_sample_noises_are_those_of_the_samples(noise: SensorNoise) -> None:
    found = starting(noise)
    assert found["EKF2_MAG_NOISE"].at_rest == pytest.approx(MAG, rel=0.05)
    assert found["EKF2_MAG_NOISE"].in_flight == pytest.approx(MAG, rel=0.05)
    assert found["EKF2_BARO_NOISE"].at_rest == pytest.approx(BARO, rel=0.1)
    assert "keep" not in found["EKF2_BARO_NOISE"].words
    assert found["EKF2_BARO_NOISE"].start_with == found["EKF2_BARO_NOISE"].flown


def test_thinned_samples_keep_the_density_of_the_sensor() -> None:
    topics = made_topics(np.random.default_rng(3))
    topics["sensor_combined", 0] = {name: one[::4] for name, one in topics["sensor_combined", 0].items()}
    gyro = sensor_noise(made_flight(topics), AIRBORNE).sensors["gyro"]
    assert gyro.figures.noise_density.value == pytest.approx(GYRO / math.sqrt(200.0), rel=0.06)
    assert gyro.vibration is not None
    assert gyro.vibration.density_in_flight == pytest.approx(5.0 * GYRO / math.sqrt(200.0), rel=0.06)


def test_a_log_that_loses_a_sample_of_fifteen_says_nothing_of_the_flight() -> None:
    topics = made_topics(np.random.default_rng(8))
    kept = np.arange(len(topics["sensor_combined", 0]["timestamp"])) % 15 != 10
    topics["sensor_combined", 0] = {name: one[kept] for name, one in topics["sensor_combined", 0].items()}
    gyro = starting(sensor_noise(made_flight(topics), AIRBORNE))["EKF2_GYR_NOISE"]
    assert gyro.in_flight is None
    assert "loses samples" in gyro.words
    assert gyro.start_with == pytest.approx(gyro.flown)


def test_a_log_that_begins_in_the_air_is_told_to_begin_earlier() -> None:
    topics = made_topics(np.random.default_rng(4))
    status = topics["vehicle_status", 0]
    status["arming_state"] = np.full(3, 2, np.uint8)
    found = sensor_noise(made_flight(topics), AIRBORNE)
    assert found.still == ()
    gyro = starting(found)["EKF2_GYR_NOISE"]
    assert gyro.at_rest is None
    assert gyro.in_flight == pytest.approx(5.0 * GYRO / math.sqrt(2.0), rel=0.03)
    assert "stands still for only 0 s" in gyro.words
    assert found.vibration_limited == ()


def test_a_stuck_sensor_is_told() -> None:
    topics = made_topics(np.random.default_rng(5))
    mag = topics["vehicle_magnetometer", 0]
    for axis in range(3):
        mag[f"magnetometer_ga[{axis}]"][2000:2500] = mag[f"magnetometer_ga[{axis}]"][2000]
    stuck = sensor_noise(made_flight(topics), AIRBORNE).sensors["mag"].stuck
    assert stuck.longest_s == pytest.approx(10.0, abs=0.05)
    assert stuck.share == pytest.approx(10.0 / 60.0, abs=0.01)


def test_an_empty_flight_has_no_sensors() -> None:
    found = sensor_noise(made_flight({}), ())
    assert found.sensors == {}
    assert found.document()["starting"] == []


def test_file_holds_the_document(tmp_path: Path) -> None:
    flight, results = tmp_path / "flight", tmp_path / "results"
    flight.mkdir()
    results.mkdir()
    write_flight(flight, made_flight(made_topics(np.random.default_rng(1))))
    found = write_sensor_noise(flight, results)
    document = read_document(results / "sensor_noise.json")
    assert document == json.loads(json.dumps(found.document()))
    assert document["still_s"][0][0] == pytest.approx(0.0, abs=0.1)
    with pytest.raises(UserError):
        write_sensor_noise(tmp_path / "nothing", results)


def test_pooled_over_flights_of_one_device(noise: SensorNoise) -> None:
    other_topics = made_topics(np.random.default_rng(6))
    third_topics = made_topics(np.random.default_rng(7))
    third_topics["sensor_selection", 0]["gyro_device_id"][:] = 99
    flights = [noise] + [
        sensor_noise(made_flight(topics, name), AIRBORNE)
        for topics, name in ((other_topics, "second"), (third_topics, "third"))
    ]
    pooled = {(one.sensor.name, one.device_id): one for one in pooled_sensors([one.document() for one in flights])}
    gyro, accel = pooled["gyro", 11], pooled["accel", 12]
    assert [share.flight for share in gyro.flights] == ["made", "second"]
    assert [share.flight for share in pooled["gyro", 99].flights] == ["third"]
    assert len(accel.flights) == 3
    assert gyro.curve is not None
    assert gyro.curve.terms == pytest.approx(sum(one.sensors["gyro"].curve.terms for one in flights[:2]))
    assert gyro.figures is not None
    assert gyro.figures.noise_density.value == pytest.approx(GYRO / math.sqrt(200.0), rel=0.03)
    white, walk = gyro.starting
    assert white.in_flight == pytest.approx(5.0 * GYRO / math.sqrt(2.0), rel=0.03)
    assert walk.at_rest is None
    assert gyro.histogram(at_rest=False).sum() == sum(
        axis.samples for one in flights[:2] for axis in one.sensors["gyro"].in_flight
    )
    json.dumps([one.document() for one in pooled.values()])


def test_what_vibration_makes_of_a_simulated_vehicle_is_what_was_put_in(project_root: Path) -> None:
    """`mistuned_quadrotor.yaml`: at rest 0.0025 and 0.00012 per √Hz, vibration at hover 0.08 and 0.006."""
    from fusetune.design.missions.mission import load_mission
    from fusetune.execute.simulation import fly
    from fusetune.execute.vehicle import load_vehicle

    mission = load_mission(project_root / "config/missions/survey.yaml")
    vehicle = load_vehicle(project_root / "config/vehicles/mistuned_quadrotor.yaml")
    flight = canonical(fly(mission, vehicle, {}, seed=4))
    found = sensor_noise(flight, airborne_intervals(flight, {}))
    named = starting(found)
    assert named["EKF2_ACC_NOISE"].at_rest == pytest.approx(0.025, rel=0.05)
    assert named["EKF2_GYR_NOISE"].at_rest == pytest.approx(0.0012, rel=0.05)
    # manoeuvres take more than hover, and shake more
    assert named["EKF2_ACC_NOISE"].in_flight == pytest.approx(0.8, rel=0.1)
    assert named["EKF2_GYR_NOISE"].in_flight == pytest.approx(0.06, rel=0.1)
    assert found.vibration_limited == ("gyro", "accel")
    vibration = found.sensors["accel"].vibration
    assert vibration is not None
    assert vibration.tones.listed[0].tone.frequency_hz == pytest.approx(92.0, rel=0.03)


def test_noise_of_the_shared_simulated_log_is_what_it_was_made_with(shared_logs: Path) -> None:
    """Per sample 0.004 rad/s, 0.08 m/s² at 200 Hz, 0.004 Gs at 50 Hz, as its standard deviations on the ground say."""
    from fusetune.px4.ulog.reader import read_ulog

    flight = canonical(read_ulog(shared_logs / "synthetic__mc_gnss.ulg"))
    found = sensor_noise(flight, airborne_intervals(flight, {}))
    for name, rate in (("gyro", 200.0), ("accel", 200.0), ("mag", 50.0)):
        series = found.sensors[name].series
        by_hand = series.values[series.inside(found.still)].std(axis=0).mean() / math.sqrt(rate)
        assert found.sensors[name].figures.noise_density.value == pytest.approx(by_hand, rel=0.03)


def test_a_real_log_that_begins_armed_says_so(shared_logs: Path) -> None:
    from fusetune.px4.ulog.reader import read_ulog

    flight = canonical(read_ulog(shared_logs / "SkyRats__log_8_2021-8-12-15-53-14.ulg"))
    found = sensor_noise(flight, airborne_intervals(flight, {}))
    assert found.still == ()
    for name in ("gyro", "accel"):
        vibration = found.sensors[name].vibration
        assert vibration is not None
        # the same vehicle shows its motors near 95 Hz in all of its logs of that day
        assert vibration.tones.fundamental_hz == pytest.approx(95.0, abs=3.0)
        assert vibration.tones.throttle == "varied"
        assert vibration.limited is None


def test_a_magnetometer_that_holds_one_value_tells_no_noise() -> None:
    """At rest and in flight: no division by what is not there, and the parameter stays as it flies."""
    topics = made_topics(np.random.default_rng(1))
    table = topics["vehicle_magnetometer", 0]
    topics["vehicle_magnetometer", 0] = {
        name: values if name.startswith("timestamp") else np.zeros_like(values) for name, values in table.items()
    }
    magnetometer = starting(sensor_noise(made_flight(topics), AIRBORNE))["EKF2_MAG_NOISE"]
    assert magnetometer.start_with == magnetometer.flown
    assert "tell no noise" in magnetometer.words
