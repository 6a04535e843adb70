"""Which topic is the clock of a flight, and what is judged by it."""

from __future__ import annotations

import numpy as np
import pytest

from fusetune.px4.ulog.times import ANOTHER_CLOCK, IMPOSSIBLE, clock_of, impossible_rows, newest_before

ROWS = 4000
IMU = np.arange(ROWS, dtype=np.int64) * 5_000 + 100_000_000
BARO = IMU[::10] + 300
UNIX_US = 1_700_000_000_000_000
OTHER_TIMES = {
    "zero": np.zeros(ROWS + 2, np.int64),
    "constant": np.full(ROWS + 2, 100_000_000, np.int64),
    "unix": np.arange(ROWS + 2, dtype=np.int64) * 5_000 + UNIX_US,
    "since its own start": np.arange(ROWS + 2, dtype=np.int64) * 5_000,
    "backward": 110_000_000 - np.arange(ROWS + 2, dtype=np.int64) * 5_000,
    "sawtooth": np.arange(ROWS + 2, dtype=np.int64) * 5_000 % 1_000_000,
    "negative": np.arange(ROWS + 2, dtype=np.int64) * 5_000 - 10**18,
}


def places_of(times: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Topics spread evenly over the file."""
    return {key: np.linspace(0, 10**6, len(values)).astype(np.int64) for key, values in times.items()}


@pytest.mark.parametrize("kind", OTHER_TIMES)
@pytest.mark.parametrize("imu", ["imu", "only imu"])
def test_a_topic_of_another_time_is_no_clock_however_often_it_is_logged(kind: str, imu: str) -> None:
    times = {"imu": IMU, "odd": OTHER_TIMES[kind]} | ({"baro": BARO} if imu == "imu" else {})
    places = places_of(times)
    clock = clock_of(times, places, "imu", trusted=lambda key: key != "odd")
    assert clock == "imu"
    wrong = impossible_rows(times, places, clock)
    assert set(wrong) <= {"odd"}
    needed = impossible_rows(times, places, clock, needed=lambda _: True)
    if kind not in ("constant", "backward"):
        assert set(needed) == {"odd"}
        assert needed["odd"].rows.all()
        assert needed["odd"].reason == ANOTHER_CLOCK


def test_topics_of_the_future_are_left_out_whoever_needs_them() -> None:
    times = {"imu": IMU, "odd": OTHER_TIMES["unix"]}
    assert impossible_rows(times, places_of(times), "imu")["odd"].rows.all()


def test_without_the_imu_the_majority_is_the_clock() -> None:
    times = {"odd": OTHER_TIMES["unix"], "baro": BARO, "mag": BARO + 100, "gnss": BARO + 50}
    assert clock_of(times, places_of(times), "imu") in ("baro", "mag", "gnss")


def test_an_imu_of_another_clock_costs_itself_alone() -> None:
    times = {"imu": IMU + UNIX_US, "baro": BARO, "mag": BARO + 100}
    clock = clock_of(times, places_of(times), "imu")
    assert clock in ("baro", "mag")
    assert set(impossible_rows(times, places_of(times), clock)) == {"imu"}


def test_too_few_messages_are_no_clock() -> None:
    times = {"imu": IMU[:99]}
    assert clock_of(times, places_of(times), "imu") is None
    assert impossible_rows(times, places_of(times), None) == {}


def test_single_times_that_cannot_be_are_found() -> None:
    times = {"imu": IMU.copy(), "baro": BARO.copy()}
    times["imu"][100] += 1 << 40
    times["baro"][7] = -5
    wrong = impossible_rows(times, places_of(times), clock_of(times, places_of(times), "imu"))
    assert {key: np.flatnonzero(one.rows).tolist() for key, one in wrong.items()} == {"imu": [100], "baro": [7]}
    assert {one.reason for one in wrong.values()} == {IMPOSSIBLE}


def test_newest_before_is_that_of_all_topics() -> None:
    """Large topics one by one, small ones together; the expected values are those of a plain loop."""
    rng = np.random.default_rng(0)
    times = {f"t{number}": np.sort(rng.integers(0, 10**6, size)) for number, size in enumerate((5000, 4096, 30, 1, 7))}
    places = {key: np.sort(rng.integers(0, 10**5, len(values))) for key, values in times.items()}
    asked = rng.integers(0, 10**5, 50)
    expected = [
        max([17, *(int(times[key][places[key] < place].max(initial=0)) for key in times)]) for place in asked.tolist()
    ]
    assert newest_before(asked, times, places, 17).tolist() == expected
    assert newest_before(asked, {}, {}, 17).tolist() == [17] * 50
