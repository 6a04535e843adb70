"""Indented JSON is, letter for letter, what Python's own encoder writes."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.storage.indented_json import indented

KEYS = st.text(max_size=3) | st.integers() | st.booleans() | st.none() | st.floats()
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3),
    lambda part: st.lists(part, max_size=3) | st.dictionaries(KEYS, part, max_size=3) | st.tuples(part, part),
    max_leaves=12,
)


@settings(max_examples=200, deadline=None)
@given(value=VALUES)
def test_it_is_what_python_writes(value: Any) -> None:
    assert indented(value) == json.dumps(value, indent=1, ensure_ascii=False)


def test_keys_are_sorted_and_nan_refused_where_that_is_asked_for() -> None:
    value = {"b": [{"d": 1.5, "c": []}], "a": {}}
    assert indented(value, sort_keys=True) == json.dumps(value, indent=1, sort_keys=True)
    with pytest.raises(ValueError, match="not JSON compliant"):
        indented({"b": [[float("nan")]]}, allow_nan=False)
