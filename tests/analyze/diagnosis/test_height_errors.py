"""What a barometer follows: what was put into made heights is found, and nothing else with it."""

import numpy as np
import pytest
from tests.analyze.diagnosis.made_motion import FLYING, START_US, made_motion

from fusetune.analyze.diagnosis.height_errors import GROUND_SCALE_M, HeightErrors, height_errors
from fusetune.analyze.diagnosis.motion import climbed_by
from fusetune.ekf2.numerics.constants import ONE_G

MOTION = made_motion()
AROUND = ((START_US, START_US + 70_000_000),)
TIME = np.arange(START_US + 100_000, START_US + 69_000_000, 50_000, dtype=np.int64)
THRUST, HEIGHT = MOTION.at(TIME, MOTION.thrust), MOTION.at(TIME, MOTION.height)
CLIMBED = climbed_by(MOTION.time, MOTION.velocity)


def found(more: np.ndarray | float, wind: np.ndarray | None = None) -> HeightErrors:
    noise = 0.15 * np.random.default_rng(3).normal(size=TIME.size)
    one = height_errors(TIME, MOTION.at(TIME, CLIMBED) + noise + more, MOTION, AROUND, CLIMBED, wind)
    assert one is not None
    return one


def assert_small(one: HeightErrors, *but: str) -> None:
    for name, effect in {"thrust": one.thrust, "ground": one.ground, **one.speed}.items():
        assert name in but or abs(effect.value) < 4.0 * effect.error + 0.1, name


def test_a_sound_barometer_follows_nothing() -> None:
    assert_small(found(0.0))


def test_the_wash_is_found_by_the_thrust() -> None:
    one = found(4.0 * THRUST)
    assert one.thrust.value == pytest.approx(4.0, abs=0.4)
    assert_small(one, "thrust")


def test_the_dip_near_the_ground_is_no_wash() -> None:
    one = found(-3.0 * THRUST * np.exp(-np.maximum(HEIGHT, 0.0) / GROUND_SCALE_M))
    assert one.ground.value == pytest.approx(-3.0, abs=0.4)
    assert_small(one, "ground")


def test_the_dynamic_pressure_is_found_by_direction() -> None:
    ahead = np.maximum(MOTION.at(TIME, MOTION.air_velocity())[:, 0], 0.0)
    one = found(0.8 * ahead**2 / (2.0 * ONE_G))
    assert one.speed["forward"].value == pytest.approx(0.8, abs=0.15)
    assert_small(one, "forward")


def test_the_pressure_is_that_of_the_air_and_not_of_the_way_over_ground() -> None:
    # 4 m/s from the south-west: over ground the vehicle flies as fast forward as backward, through the air it does not
    wind = np.tile(4.0 * np.sqrt(0.5), (MOTION.time.size, 2))
    ahead = np.maximum(MOTION.at(TIME, MOTION.air_velocity(wind))[:, 0], 0.0)
    pressed = 0.4 * ahead**2 / (2.0 * ONE_G)
    known, unknown = found(pressed, wind), found(pressed)
    assert known.speed["forward"].value == pytest.approx(0.4, abs=0.1)
    assert_small(known, "forward")
    assert abs(unknown.speed["forward"].value - 0.4) > abs(known.speed["forward"].value - 0.4)
    assert known.explained(TIME, MOTION) == pytest.approx(pressed, abs=0.6)


def test_a_drift_is_a_drift() -> None:
    one = found(0.05 * (TIME - TIME[0]) * 1e-6)
    assert one.drift.value == pytest.approx(0.05, abs=0.03)
    assert_small(one)


def test_flying_is_when_the_made_vehicle_flies() -> None:
    flying = (MOTION.time > FLYING[0][0] + 100_000) & (MOTION.time < FLYING[0][1] - 100_000)
    assert (MOTION.thrust[flying] > 0.5).all()
    assert (MOTION.thrust[MOTION.time < FLYING[0][0]] == 0.0).all()
