"""Figures in tables by hand."""

import math

import pytest

from fusetune.report.markup import Cell, number, signed, table


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.12345, "0.123"), (-2.0, "−2"), (1234.5, "1234"), (math.nan, "–"), (None, "–"), (0.00012345, "0.000123")],
)
def test_numbers_have_significant_digits(value: float | None, text: str) -> None:
    assert number(value).text == text


def test_signed_numbers_show_their_sign() -> None:
    assert [signed(value).text for value in (1.25, -0.04, math.inf)] == ["+1.2", "−0.0", "–"]


def test_a_table_escapes_and_aligns_numbers() -> None:
    html = table(("a<b", "n"), [("x&y", number(1.0)), ("z", Cell("–", "number"))])
    assert "<th>a&lt;b</th>" in html
    assert '<th class="number">n</th>' in html
    assert "<td>x&amp;y</td>" in html


def test_an_empty_table_keeps_its_head() -> None:
    assert "<th>a</th>" in table(("a",), [])
