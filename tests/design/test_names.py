from __future__ import annotations

import pytest

from fusetune.design.names import name_problem, one_line


@pytest.mark.parametrize("name", ["con", "CON", "Nul", "aux", "PRN", "com1", "LPT9"])
def test_devices_of_windows_are_no_names(name: str) -> None:
    problem = name_problem(name)
    assert problem is not None
    assert repr(name) in problem


@pytest.mark.parametrize("name", ["confidence", "com10", "a_con", "nul-1"])
def test_names_that_only_resemble_them_are(name: str) -> None:
    assert name_problem(name) is None


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("one\ntwo\n", "one two"),
        ("  a \t b\r\n", "a b"),
        ("a\x1b[31m b\x00", "a [31m b"),
        ("a\u2028b", "a b"),
        ("\ud800x", "x"),
        ("größer – ½", "größer – ½"),
        ("", ""),
    ],
)
def test_a_description_is_one_line_of_what_can_be_printed(text: str, line: str) -> None:
    assert one_line(text) == line
