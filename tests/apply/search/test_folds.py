"""Which flights are kept aside together."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from fusetune.apply.search.folds import folds


@given(st.integers(0, 40), st.integers(2, 10))
def test_every_flight_is_kept_aside_once_with_its_neighbours_in_time(flights: int, number: int) -> None:
    names = [f"flight_{one:02}" for one in range(flights)]
    parts = folds(names, number)
    if flights < 2:
        assert not parts
        return
    assert [name for part in parts for name in part] == names
    sizes = {len(part) for part in parts}
    assert min(sizes) >= 1
    assert max(sizes) - min(sizes) <= 1
    assert len(parts) == min(number, flights)
