"""Sequences that fill a cube: Latin hypercube and Sobol, both stable when more points are asked for."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.design.sampling import Sampling, latin_hypercube, points, sobol

NAMES = ("a", "b", "c")


def first(sampling: Sampling, number: int, seed: int = 1) -> list[tuple[float, ...]]:
    return list(itertools.islice(points(sampling, NAMES, seed), number))


@given(st.integers(0, 2**31), st.integers(0, 6))
def test_the_first_powers_of_two_are_latin_hypercubes(seed: int, power: int) -> None:
    number = 2**power
    drawn = list(itertools.islice(latin_hypercube(NAMES, seed), number))
    for column in zip(*drawn, strict=True):
        assert sorted(int(one * number) for one in column) == list(range(number))


@settings(max_examples=20, deadline=None)  # SciPy is loaded by the first
@given(st.integers(0, 1000), st.integers(0, 6))
def test_sobol_fills_each_stratum_once(seed: int, power: int) -> None:
    """Every one-dimensional projection of a (t, m, s)-net in base 2 of Sobol's is a Latin hypercube (Owen 1998)."""
    number = 2**power
    for column in zip(*itertools.islice(sobol(len(NAMES), seed), number), strict=True):
        assert sorted(int(one * number) for one in column) == list(range(number))


@pytest.mark.parametrize("sampling", ["latin_hypercube", "sobol"])
def test_more_points_leave_the_first_as_they_are_and_a_seed_makes_others(sampling: Sampling) -> None:
    assert first(sampling, 50)[:13] == first(sampling, 13)
    assert first(sampling, 13, 2) != first(sampling, 13)


def test_a_further_name_leaves_the_others_columns_of_a_latin_hypercube() -> None:
    two, three = latin_hypercube(NAMES[:2], 5), latin_hypercube(NAMES, 5)
    assert all(more[:2] == less for less, more in itertools.islice(zip(two, three, strict=False), 20))


def test_points_are_inside_the_cube() -> None:
    for sampling in ("latin_hypercube", "sobol"):
        assert all(0.0 <= one < 1.0 for point in first(sampling, 256) for one in point)
