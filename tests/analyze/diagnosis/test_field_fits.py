"""Causes of wrong magnetometer readings: each made one is fitted best by its own."""

import numpy as np
import pytest
from tests.analyze.diagnosis.made_motion import FLYING, HEADING_OFF, made_motion

from fusetune.analyze.diagnosis.field_fits import FieldFit, FieldReadings, field_fits
from fusetune.analyze.diagnosis.magnetometer_signs import earth_field, magnetometer_signs
from fusetune.px4.flight import Flight

MOTION = made_motion()
ROWS = np.arange(800, 6200, 25)
EARTH = np.array([0.21, 0.01, 0.43])
NOISE = 0.002


def fits(change: object = None, heading: float | None = HEADING_OFF) -> dict[str, FieldFit]:
    clean = FieldReadings(
        MOTION.time[ROWS] * 1e-6, np.zeros((ROWS.size, 3)), MOTION.rotation[ROWS], MOTION.thrust[ROWS]
    )
    field = clean.expected(EARTH, HEADING_OFF)
    measured = field if change is None else change(field, clean.thrust)  # type: ignore[operator]
    measured = measured + NOISE * np.random.default_rng(2).normal(size=field.shape)
    return field_fits(FieldReadings(clean.time_s, measured, clean.rotation, clean.thrust), EARTH, heading)


def best(found: dict[str, FieldFit]) -> str:
    return min(found, key=lambda name: found[name].left)


def test_sound_readings_leave_their_noise() -> None:
    assert fits()["as_told"].left == pytest.approx(NOISE, rel=0.1)


def test_a_field_of_the_body_is_found() -> None:
    body = np.array([0.08, -0.05, 0.03])
    found = fits(lambda field, _: field + body)
    assert [found["body_field"].values[f"body_field_{axis}"] for axis in "xyz"] == pytest.approx(body, abs=2e-3)
    assert found["body_field"].left < 0.3 * min(found[name].left for name in ("as_told", "scale", "mounting"))


def test_a_field_in_step_with_the_thrust_is_told_from_a_constant_one() -> None:
    coefficient = np.array([0.3, 0.2, -0.1])
    found = fits(lambda field, thrust: field + thrust[:, None] * coefficient)
    assert [found["motor_field"].values[f"motor_field_{axis}"] for axis in "xyz"] == pytest.approx(
        coefficient, abs=0.01
    )
    assert found["motor_field"].left < 0.6 * found["body_field"].left


def test_scales_are_found_by_axis() -> None:
    scale = np.array([1.3, 0.9, 1.1])
    found = fits(lambda field, _: field * scale)
    assert [found["scale"].values[f"scale_{axis}"] for axis in "xyz"] == pytest.approx(scale, abs=5e-3)
    assert best(found) == "scale"


@pytest.mark.parametrize("degrees", [45, 90, 180, 315])
def test_a_turn_about_the_vertical_is_found_by_the_heading_of_gnss(degrees: int) -> None:
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    found = fits(lambda field, _: field @ turn.T)
    assert found["mounting"].left == pytest.approx(NOISE, rel=0.1)
    assert found["mounting"].turn == pytest.approx(turn, abs=1e-9)


def test_without_a_heading_a_turn_about_the_vertical_is_none() -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found = fits(lambda field, _: field @ turn.T, None)
    assert found["mounting"].turn is not None
    assert abs(found["mounting"].turn[2, 2]) < 0.5
    assert found["as_told"].heading != pytest.approx(HEADING_OFF, abs=0.5)


def flown(change: object = None) -> Flight:
    """A flight at 47° N, 8° E with the magnetometer's readings at 50 Hz."""
    fix = {"timestamp": MOTION.time[:1], "fix_type": np.array([3])}
    fix |= {"latitude_deg": np.array([47.4]), "longitude_deg": np.array([8.5])}
    earth = earth_field(Flight("made", {("vehicle_gps_position", 0): fix}))
    assert earth is not None
    rows = np.arange(0, MOTION.time.size, 2)
    clean = FieldReadings(
        MOTION.time[rows] * 1e-6, np.zeros((rows.size, 3)), MOTION.rotation[rows], MOTION.thrust[rows]
    )
    field = clean.expected(earth, HEADING_OFF)
    field = field if change is None else change(field)  # type: ignore[operator]
    field = field + NOISE * np.random.default_rng(3).normal(size=field.shape)
    table = {"timestamp": MOTION.time[rows], "timestamp_sample": MOTION.time[rows]}
    table |= {f"magnetometer_ga[{axis}]": field[:, axis].astype(np.float32) for axis in range(3)}
    return Flight("made", {("vehicle_gps_position", 0): fix, ("vehicle_magnetometer", 0): table})


def test_a_wrong_heading_of_gnss_is_no_fault_of_the_magnetometer() -> None:
    # 26° off, as on legs along one line; the readings fit the field under a heading of their own
    one = magnetometer_signs(flown(), MOTION, FLYING, (HEADING_OFF + np.radians(26.0), np.radians(3.6)))
    assert one is not None
    assert not one.by_gnss
    # means over half a second of a vehicle that turns leave a little more than noise; a heading that is 26° off 0.05
    assert one.fits["as_told"].left < 0.005


def test_a_field_of_the_body_and_a_mounting_are_no_wrong_heading() -> None:
    for change in (lambda field: field + np.array([0.08, -0.05, 0.0]), lambda field: field @ ABOUT_DOWN_45.T):
        one = magnetometer_signs(flown(change), MOTION, FLYING, (HEADING_OFF, np.radians(1.0)))
        assert one is not None
        assert one.by_gnss


ABOUT_DOWN_45 = np.array([[0.5**0.5, -(0.5**0.5), 0.0], [0.5**0.5, 0.5**0.5, 0.0], [0.0, 0.0, 1.0]])
