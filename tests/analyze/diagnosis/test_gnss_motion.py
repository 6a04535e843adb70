"""GNSS velocity against inertial motion: what was put into made velocities is found again, within its errors."""

import numpy as np
import pytest
from tests.analyze.diagnosis.made_motion import FLYING, HEADING_OFF, made_motion, true_rotation

from fusetune.analyze.diagnosis.gnss_motion import GnssMotion, gnss_motion
from fusetune.px4.flight import TopicTable

MOTION = made_motion()
TOLD = {"EKF2_GPS_DELAY": 110.0}


def table(delay_s: float, arm: np.ndarray, noise: float = 0.08) -> TopicTable:
    """Messages five times a second of an antenna at `arm`, that late, good to `noise`."""
    time = np.arange(FLYING[0][0], FLYING[0][1], 200_000, dtype=np.int64)
    at = time - round(delay_s * 1e6)
    swept = np.einsum("nij,nj->ni", true_rotation(MOTION), np.cross(MOTION.body_rate, arm))
    velocity = MOTION.at(at, MOTION.velocity + swept)
    velocity = velocity + noise * np.random.default_rng(4).normal(size=velocity.shape)
    columns = {f"vel_{axis}_m_s": velocity[:, i] for i, axis in enumerate("ned")}
    return {"timestamp": time, "fix_type": np.full(time.size, 3), **columns}


def found(delay_s: float, arm: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> GnssMotion:
    one = gnss_motion(table(delay_s, np.array(arm)), MOTION, FLYING, TOLD)
    assert one is not None
    return one


@pytest.mark.parametrize("delay_s", [0.03, 0.11, 0.22])
def test_the_delay_that_was_made_is_found(delay_s: float) -> None:
    one = found(delay_s)
    assert one.fit.delay_s == pytest.approx(delay_s, abs=0.012)
    assert abs(one.fit.delay_s - delay_s) < 4.0 * one.fit.delay_error_s


def test_the_antennas_place_is_found_beside_the_delay() -> None:
    arm = np.array([0.35, -0.2, -0.1])
    one = found(0.16, (0.35, -0.2, -0.1))
    assert one.arm == pytest.approx(arm, abs=0.05)
    assert one.fit.delay_s == pytest.approx(0.16, abs=0.012)


def test_the_heading_needs_no_magnetometer() -> None:
    one = found(0.11)
    assert one.heading == pytest.approx(HEADING_OFF, abs=0.02)
    assert one.heading_error < 0.02


def test_the_noise_is_that_of_the_receiver() -> None:
    assert found(0.11).fit.noise == pytest.approx(0.08, rel=0.25)


def test_too_short_a_flight_tells_nothing() -> None:
    first = ((FLYING[0][0], FLYING[0][0] + 7_000_000),)
    assert gnss_motion(table(0.11, np.zeros(3)), MOTION, first, TOLD) is None
