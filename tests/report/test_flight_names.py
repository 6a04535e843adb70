"""Short names of flights: unlike each other, and no longer than fits."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from fusetune.report.flight_names import LONGEST, in_time_order, short_names

NAMES = [
    "SkyRats__log_8_2021-8-12-15-53-14",
    "SkyRats__log_9_2021-8-12-15-54-10",
    "Chainplain__log_9_2024-10-14-15-00-06",
    "flight_1_paper1",
    "log_61_2024-02-06",
    "Auterion__corrupt_unregistered_msg_id",
]


def test_owner_and_date_go_where_the_names_stay_apart() -> None:
    assert list(short_names(NAMES).values()) == [
        "log_8",
        "log_9",
        "Chainplain__log_9",
        "flight_1_paper1",
        "log_61",
        "corrupt_unre…_msg_id",
    ]


def test_flights_of_one_owner_that_would_be_alike_keep_their_date() -> None:
    names = ["a__log_1_2021-8-12", "a__log_1_2021-8-13"]
    assert list(short_names(names).values()) == ["log_1_2021-8-12", "log_1_2021-8-13"]


@given(st.lists(st.text(alphabet="ab_-12", max_size=60), unique=True, max_size=40))
def test_no_two_are_alike_and_none_is_long(names: list[str]) -> None:
    short = short_names(names)
    assert list(short) == names
    assert len(set(short.values())) == len(names)
    assert all(len(one) <= LONGEST for one in short.values())


def test_the_oldest_stands_first_and_what_tells_no_time_last_by_number() -> None:
    rows = [
        {"flight": "log_10", "recorded": ""},
        {"flight": "log_9", "recorded": None},
        {"flight": "new", "recorded": "2024-01-01T00:00:00Z"},
        {"flight": "old", "recorded": "2021-01-01T00:00:00Z"},
    ]
    assert in_time_order(rows) == ["old", "new", "log_9", "log_10"]
