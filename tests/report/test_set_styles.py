"""Tests of the looks of the sets."""

from __future__ import annotations

from random import Random

from hypothesis import given
from hypothesis import strategies as st

from fusetune.report.set_styles import CHOSEN_INDEX, COLOURS, MARKERS, SetStyle, set_style, set_styles

_FREE = (COLOURS - 2) * (len(MARKERS) - 1)
"""Looks but for the colours of the present and the chosen set, and the present one's marker."""

_names = st.lists(st.text(min_size=1, max_size=8), min_size=1, max_size=60, unique=True)


def test_the_present_and_the_chosen_set_have_colours_of_their_own() -> None:
    """Black with a circle, and blue; the chosen one keeps the marker that its name gives it."""
    names = ["present", *(f"paper{i}" for i in range(1, 7))]
    styles = set_styles(names, "present", "paper5")
    assert styles["present"] == SetStyle(0, "circle")
    assert styles["paper5"] == SetStyle(CHOSEN_INDEX, set_styles(names, "present")["paper5"].marker)
    assert sorted(styles[name].index for name in names)[:2] == [0, CHOSEN_INDEX]


@given(_names, st.randoms())
def test_looks_follow_from_the_names_alone(names: list[str], random: Random) -> None:
    """In any order of the sets; unlike ones as long as there are any, and all colours before one comes again."""
    styles = set_styles(names, names[0])
    shuffled = random.sample(names, len(names))
    assert set_styles(shuffled, names[0]) == styles
    others = [styles[name] for name in names[1:]]
    assert len(set(others)) == min(len(others), _FREE)
    assert len({one.index for one in others}) == min(len(others), COLOURS - 2)
    assert SetStyle(0, "circle") not in others


def test_a_look_is_the_same_in_every_run() -> None:
    """The CRC-32 of "paper1" is 2001092742 (zlib): of 6 colours and 7 markers the first and the third."""
    assert set_style("paper1", "present") == SetStyle(CHOSEN_INDEX + 1, "triangle")
    assert set_styles(["present", "paper1"], "present")["paper1"] == set_style("paper1", "present")
