"""Sizes of resets from what is published around them; expectations by hand."""

from typing import Any

import numpy as np
import pytest

from fusetune.analyze.replaying.replayed_set import RESET_COUNTERS, ReplayedSet
from fusetune.analyze.scoring.reset_jumps import JumpFigures, jump_figures, reset_jumps, significant

TIME = np.arange(200, dtype=np.int64) * 10_000
SECONDS = TIME * 1e-6


def record(counters: dict[str, np.ndarray], **columns: np.ndarray) -> ReplayedSet:
    """A filter at 100 Hz, at rest but for the columns that are given."""
    local: dict[str, Any] = {name: np.zeros(200) for name in ("x", "y", "z", "vx", "vy", "vz", "heading")}
    local |= {name: np.zeros(200, np.int32) for name in RESET_COUNTERS.values()} | counters | columns
    return ReplayedSet("one", {}, {}, {}, {}, {}, local | {"timestamp": TIME})


def step(row: int, size: float = 1.0) -> np.ndarray:
    return np.where(np.arange(200) >= row, size, 0.0)


def test_a_position_jump_is_what_the_velocity_does_not_explain() -> None:
    x, y = 20.0 * SECONDS + step(50, 3.0), -10.0 * SECONDS + step(50, 4.0)
    jumps = reset_jumps(
        record({"xy_reset_counter": step(50)}, x=x, y=y, vx=np.full(200, 20.0), vy=np.full(200, -10.0))
    )["horizontal_position"]
    assert jumps.time.tolist() == [500_000]
    assert jumps.size == pytest.approx([5.0])


def test_a_velocity_jump_is_what_the_acceleration_does_not_explain() -> None:
    vz = 8.0 * SECONDS + step(50, 0.6) - step(120, 0.2)
    jumps = reset_jumps(record({"vz_reset_counter": step(50) + step(120)}, vz=vz))["vertical_velocity"]
    assert jumps.size == pytest.approx([0.6, 0.2])


def test_a_heading_jump_goes_the_short_way_round() -> None:
    """From 178° to −178° is 4°, while turning at 90 °/s, or 0.9° per update."""
    heading = np.radians(178.0 + 90.0 * (SECONDS - SECONDS[49]) + step(50, 4.0))
    wrapped = (heading + np.pi) % (2 * np.pi) - np.pi
    jumps = reset_jumps(record({"heading_reset_counter": step(50)}, heading=wrapped))["heading"]
    assert jumps.size == pytest.approx([4.0])


def test_a_counter_that_wraps_is_one_reset() -> None:
    counter = np.where(np.arange(200) < 100, 255, 0).astype(np.uint8)
    assert reset_jumps(record({"z_reset_counter": counter}, z=step(100, -2.0)))["height"].size == pytest.approx([2.0])


def test_figures_are_the_largest_and_the_root_mean_square() -> None:
    jumps = reset_jumps(record({"z_reset_counter": step(50) + step(60)}, z=step(50, 3.0) + step(60, 4.0)))["height"]
    assert jump_figures("height", jumps) == JumpFigures(4.0, pytest.approx(np.sqrt(12.5), abs=1e-4), "m")


def test_a_jump_is_significant_beyond_its_limit_and_those_at_one_time_are_one() -> None:
    counters = {"xy_reset_counter": step(50) + step(90), "vxy_reset_counter": step(50), "z_reset_counter": step(70)}
    found = reset_jumps(record(counters, x=step(50, 5.0) + step(90, 0.9), vx=step(50, 0.6), z=step(70, 1.1)))
    # x at 50 with vx, z at 70; the position moves by 0.9 m at 90, and at 51 what the velocity jump explains
    assert significant(found) == 2


def test_what_is_not_known_is_significant() -> None:
    one = record({"heading_reset_counter": step(50)})
    local = {name: values for name, values in one.local_position.items() if name != "heading"}
    found = reset_jumps(ReplayedSet("one", {}, {}, {}, {}, {}, local))
    assert significant(found) == 1
    assert jump_figures("heading", found["heading"]) == JumpFigures(None, None, "deg")
