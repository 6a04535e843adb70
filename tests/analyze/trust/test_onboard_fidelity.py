"""Replay against the vehicle's own innovations, on hand-made rows."""

import numpy as np
import pytest

from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.analyze.trust.onboard_fidelity import judge_onboard_fidelity
from fusetune.px4.flight import Flight, ParameterHistory
from fusetune.save.replayed_release import replayed_release

START = 10_000_000


def samples(times, innovation):
    n = len(times)
    variance, unknown = np.full(n, 0.04), np.full(n, np.nan)
    axis = AxisSamples(times, unknown, innovation, variance, unknown, np.zeros(n, bool), np.ones(n, bool))
    return {("gnss_vel", 0): axis}


def judged(scale, *, flight=None):
    """The vehicle logged every fifth sample, 5 ms later; the replay's innovations are `scale` times as large."""
    times = START + 100_000 * np.arange(600)
    wave = np.sin(np.arange(600) * 0.7)
    replayed = samples(times, scale * wave)
    onboard = samples(times[::5] + 5_000, wave[::5])
    flight = flight or Flight("f")
    return judge_onboard_fidelity(flight, replayed, onboard, replayed_release(flight, modelled=("v1.16",)))


@pytest.mark.parametrize("scale", [1.0, 1.05, 1.6, 3.0])
def test_innovations_of_another_size_differ_by_as_much(scale):
    result = judged(scale)
    assert result.median_relative_rms == pytest.approx(abs(scale - 1.0), abs=1e-9)
    assert result.axes[0].rms_ratio == pytest.approx(scale)


def test_first_ten_seconds_of_aiding_do_not_count():
    # 600 samples at 10 Hz, every fifth logged, 10 s cut: (600 - 100) / 5
    assert judged(1.0).axes[0].samples == 100


def test_reasons_name_what_the_log_lacks():
    imu = START + 5_000 * np.arange(2000)
    topics = {
        ("sensor_combined", 0): {"timestamp": imu, "gyro_integral_dt": np.full(2000, 4_500)},
        ("vehicle_magnetometer", 0): {"timestamp": START + 500_000 * np.arange(20)},
        ("vehicle_land_detected", 0): {"timestamp": np.array([START, START + 2_000_000]), "landed": np.array([1, 0])},
    }
    result = judged(2.0, flight=Flight("f", topics, info={"ver_sw_release": 0x010D03FF}))
    assert [reason.id for reason in result.reasons] == ["imu_coverage", "magnetometer", "log_start", "firmware"]
    # 1999 intervals of 4.5 ms in 1999 times 5 ms, and messages every half second
    assert [reason.figure for reason in result.reasons[:3]] == pytest.approx([0.9, 2.0, 2.0])
    text = " / ".join(reason.in_words for reason in result.reasons)
    assert "10.0%" in text
    assert "magnetometer at only 2.0 Hz" in text
    assert "2 s before take-off" in text
    assert "v1.13.3" in text


def test_a_slow_sensor_is_not_put_down_to_the_logger():
    imu = START + 5_000 * np.arange(2000)
    updates = {"timestamp": imu, "vehicle_air_data_timestamp_rel": np.full(2000, 0x7FFF, np.int16)}
    updates["vehicle_air_data_timestamp_rel"][::100] = 0
    landed = {"timestamp": np.array([START, START + 2_000_000]), "landed": np.array([1, 0])}
    topics = {
        ("sensor_combined", 0): {"timestamp": imu, "gyro_integral_dt": np.full(2000, 5_000)},
        ("vehicle_air_data", 0): {"timestamp": imu[::100]},
        ("vehicle_land_detected", 0): landed,
        ("ekf2_timestamps", 0): updates,
    }
    flight = Flight("f", topics, ParameterHistory({"SDLOG_PROFILE": 3, "SDLOG_MODE": 2}))
    text = " / ".join(reason.in_words for reason in judged(2.0, flight=flight).reasons)
    assert "barometer itself gives only 2.0 Hz" in text
    assert "SDLOG" not in text
    flight.parameters.initial |= {"SDLOG_PROFILE": 1, "SDLOG_MODE": 0}
    del topics["ekf2_timestamps", 0]
    text = " / ".join(reason.in_words for reason in judged(2.0, flight=flight).reasons)
    assert "SDLOG_PROFILE = 3" in text
    assert "SDLOG_MODE = 2" in text


def test_log_without_innovations_of_its_own_is_not_compared():
    times = START + 100_000 * np.arange(200)
    replayed = samples(times, np.ones(200))
    onboard = samples(times[:0], np.ones(0))
    result = judge_onboard_fidelity(Flight("f"), replayed, onboard, replayed_release(Flight("f")))
    assert result.median_relative_rms is None
    assert result.axes == ()
