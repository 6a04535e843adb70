"""Drag and airspeed scale of made flights through gusts of known drag, scale and wind."""

from types import SimpleNamespace

import numpy as np
import pytest

from fusetune.analyze.effects import airspeed, drag
from fusetune.analyze.effects.drag import KAPPA_X, DragFit, M

STEP_S, SECONDS = 0.1, 60.0
TIME_S = np.arange(0.0, SECONDS, STEP_S)
SPEED_M_S, WIND, GUST_M_S, GUST_MEMORY_S = 7.0, (1.0, -2.0), 1.0, 5.0
MOMENTUM, KAPPA = 0.3, 0.01
NOISE_M_S2 = 0.03


def gusts(rng: np.random.Generator) -> np.ndarray:
    kept = np.exp(-STEP_S / GUST_MEMORY_S)
    found = np.zeros((TIME_S.size, 2))
    for row in range(1, TIME_S.size):
        found[row] = kept * found[row - 1] + GUST_M_S * np.sqrt(1.0 - kept**2) * rng.normal(size=2)
    return found


def flown(seed: int) -> tuple[SimpleNamespace, np.ndarray]:
    """A box with the nose north, then another east, through gusts: motion and true wind (N, 2)."""
    rng = np.random.default_rng(seed)
    way = 2.0 * np.pi * TIME_S / 15.0
    velocity = SPEED_M_S * np.column_stack([np.tanh(3.0 * np.sin(way)), np.tanh(3.0 * np.cos(way)), 0.0 * way])
    heading = np.where(TIME_S < 0.5 * SECONDS, 0.0, 0.5 * np.pi)
    rotation = np.zeros((TIME_S.size, 3, 3))
    rotation[:, 0, 0] = rotation[:, 1, 1] = np.cos(heading)
    rotation[:, 1, 0], rotation[:, 0, 1], rotation[:, 2, 2] = np.sin(heading), -np.sin(heading), 1.0
    wind = WIND + gusts(rng)
    through = velocity.copy()
    through[:, :2] -= wind
    air = np.einsum("nji,nj->ni", rotation, through)
    speed = np.linalg.norm(air, axis=1)[:, None]
    force = -(MOMENTUM + KAPPA * speed) * air + NOISE_M_S2 * rng.normal(size=air.shape)
    return SimpleNamespace(time_s=TIME_S, velocity=velocity, rotation=rotation, specific_force=force, air=air), wind


def fitted(motion: SimpleNamespace) -> DragFit:
    used = np.ones(TIME_S.size, bool)
    found = drag._gauss_newton(motion, used)  # type: ignore[arg-type]
    assert not isinstance(found, str)
    return DragFit(*found, 1.2, used)


def test_gusts_do_not_make_the_drag_larger() -> None:
    """Means of twenty flights within three of their standard errors; taken with the gusts κ is a third more."""
    found = np.array([fitted(flown(seed)[0]).likeliest.constants for seed in range(20)])
    for index, true in ((M, MOMENTUM), (KAPPA_X, KAPPA)):
        assert abs(np.mean(found[:, index]) - true) < 3.0 * np.std(found[:, index]) / np.sqrt(20)


def test_the_wind_is_off_by_what_its_errors_say() -> None:
    """Mean wind of ten flights over the standard deviation that the courses of errors give is about 1."""
    off = []
    for seed in range(10):
        motion, wind = flown(seed)
        fit = fitted(motion)
        spread = np.linalg.norm(fit.wind_errors(TIME_S).mean(axis=0), axis=1)
        off += ((fit.wind(TIME_S) - wind).mean(axis=0) / spread).tolist()
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 1.6


@pytest.mark.parametrize("scale", [0.8, 1.3])
def test_airspeed_scale_of_a_tube_that_flies_sideways_as_well(scale: float) -> None:
    """Pressures of what comes along the tube, with noise of 1 Pa (2 · 1/1.2 m²/s²) and a zero of 0.5 m²/s²."""
    motion, _ = flown(3)
    rng, fit = np.random.default_rng(3), fitted(motion)
    ahead = motion.air[:, 0]
    squared = scale**2 * ahead * np.abs(ahead) + 0.5 + 1.7 * rng.normal(size=ahead.size)
    velocity = motion.velocity.copy()
    velocity[:, :2] -= fit.wind(TIME_S)
    air = airspeed._Air(TIME_S, squared, motion.rotation[:, :, 0], velocity, fit.wind_errors(TIME_S), True)
    found = airspeed._gauss_newton(air)
    assert found is not None
    assert abs(found.constants[airspeed.SCALE] - scale**2) < found.half_width(airspeed.SCALE)
    assert np.sqrt(found.constants[airspeed.SCALE]) == pytest.approx(scale, rel=0.05)
