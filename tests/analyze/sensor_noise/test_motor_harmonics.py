from __future__ import annotations

import numpy as np
import pytest

from fusetune.analyze.flight.throttle import Throttle
from fusetune.analyze.sensor_noise.motor_harmonics import MotorTones, motor_tones, shown_at
from fusetune.analyze.sensor_noise.sensor_series import SENSORS, SensorSeries
from fusetune.analyze.sensor_noise.spectrum import spectrum, tones

RATE_HZ, LENGTH_S = 200.0, 60.0
TIME = np.arange(0.0, LENGTH_S, 1.0 / RATE_HZ)
WHOLE = ((0, round(LENGTH_S * 1e6)),)
NOISE = 0.02


def throttle(at_s: np.ndarray) -> np.ndarray:
    return 0.5 + 0.08 * np.sin(2.0 * np.pi * at_s / 12.0)


def turning(hover_hz: float, hz_per_throttle: float) -> np.ndarray:
    """Phase of a rotor that follows the throttle."""
    return 2.0 * np.pi * np.cumsum(hover_hz + hz_per_throttle * (throttle(TIME) - 0.5)) / RATE_HZ


def series(signal: np.ndarray) -> SensorSeries:
    noise = NOISE * np.random.default_rng(1).standard_normal((len(TIME), 3))
    values = noise + signal[:, None] * np.array([1.0, 0.0, 0.0])
    return SensorSeries(
        SENSORS["accel"], "sensor_combined", np.round(TIME * 1e6).astype(np.int64), values, 0.005, 0.005, 0
    )


def found_in(signal: np.ndarray, *, follows: bool = True) -> MotorTones:
    given = series(signal)
    whole = spectrum(given, WHOLE)
    assert whole is not None
    at = np.arange(0.0, LENGTH_S, 0.1)
    command = Throttle(np.round(at * 1e6).astype(np.int64), throttle(at), "made") if follows else None
    return motor_tones(given, WHOLE, tones(whole), command)


def test_level_and_amplitude_are_those_that_were_made() -> None:
    whole = spectrum(series(0.5 * np.sin(2.0 * np.pi * 60.0 * TIME)), WHOLE)
    assert whole is not None
    # white noise of σ at rate f has the one-sided density 2 σ² / f
    assert whole.broadband() == pytest.approx(2.0 * NOISE**2 / RATE_HZ, rel=0.05)
    (tone,) = tones(whole)
    assert tone.frequency_hz == pytest.approx(60.0, abs=0.3)
    assert tone.amplitude == pytest.approx(0.5, rel=0.05)


def test_white_noise_has_no_tones() -> None:
    whole = spectrum(series(np.zeros(len(TIME))), WHOLE)
    assert whole is not None
    assert tones(whole) == ()


def test_fundamental_and_multiple_of_motors_follow_the_throttle() -> None:
    phase = turning(40.0, 50.0)
    found = found_in(0.4 * np.sin(phase) + 0.3 * np.sin(2.0 * phase))
    assert found.throttle == "varied"
    assert found.fundamental_hz == pytest.approx(40.0, rel=0.06)
    by_multiple = {one.multiple: one for one in found.listed}
    assert by_multiple[1].slope_hz == pytest.approx(50.0, rel=0.35)
    assert by_multiple[2].tone.frequency_hz == pytest.approx(80.0, rel=0.06)
    assert not by_multiple[2].folded


def test_a_tone_that_goes_against_the_throttle_is_folded() -> None:
    # 130 Hz at hover in a log of 200 Hz shows at 70, and goes down as the motors speed up
    found = found_in(0.4 * np.sin(turning(130.0, 60.0)))
    (one,) = found.listed
    assert one.tone.frequency_hz == pytest.approx(70.0, rel=0.06)
    assert one.folded
    assert one.slope_hz == pytest.approx(-60.0, rel=0.35)
    assert found.fundamental_hz is None


def test_a_steady_tone_is_no_motor() -> None:
    found = found_in(0.4 * np.sin(2.0 * np.pi * 60.0 * TIME))
    assert found.listed[0].slope_hz is None
    assert found.fundamental_hz is None


def test_second_multiple_is_known_where_it_is_folded() -> None:
    phase = 2.0 * np.pi * 85.0 * TIME
    found = found_in(0.4 * np.sin(phase) + 0.3 * np.sin(2.0 * phase), follows=False)
    assert found.throttle == "not logged"
    assert found.fundamental_hz == pytest.approx(85.0, abs=0.5)
    assert {(one.multiple, one.folded) for one in found.listed} == {(1, False), (2, True)}


def test_where_a_log_shows_a_tone() -> None:
    assert [shown_at(f, 200.0) for f in (60.0, 130.0, 230.0, 200.0)] == pytest.approx([60.0, 70.0, 30.0, 0.0])


def test_floor_is_read_beside_the_shaking_of_motors() -> None:
    """Four rotors between 50 and 90 Hz, each wandering by some Hz, fill most of the band; the white noise is below."""
    rng = np.random.default_rng(4)
    shaking = np.zeros(len(TIME))
    for hover in (52.0, 63.0, 75.0, 86.0):
        wandering = hover + 4.0 * np.sin(2.0 * np.pi * TIME / 7.0 + rng.uniform(0.0, 6.0))
        shaking += 0.3 * np.sin(2.0 * np.pi * np.cumsum(wandering) / RATE_HZ)
    whole = spectrum(series(shaking), WHOLE)
    assert whole is not None
    assert whole.broadband() == pytest.approx(2.0 * NOISE**2 / RATE_HZ, rel=0.15)
