"""Figures in tables by hand."""

import math

import pytest

from fusetune.report.markup import (
    Cell,
    Html,
    details,
    drawn,
    grouped_table,
    link,
    number,
    paragraph,
    section,
    signed,
    table,
)


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
    assert '<th scope="col">a&lt;b</th>' in html
    assert '<th scope="col" class="number">n</th>' in html
    assert '<td data-label="a&lt;b">x&amp;y</td>' in html


def test_where_nothing_is_there_is_no_table_section_or_part_that_opens() -> None:
    assert table(("a",), []) == section("A", "", "") == details("A", "") == drawn("") == ""


def test_rows_stand_in_groups_under_their_names() -> None:
    html = grouped_table(("a", "b"), {"first <1>": [("x", "y")], "second": [("z", Html("<b>w</b>"))]})
    assert html.count("<tbody>") == 2
    assert '<th scope="rowgroup" colspan="2">first &lt;1&gt;</th>' in html
    assert html.index("second") < html.index("<b>w</b>")


def test_names_in_back_quotes_are_code_and_what_is_in_them_is_escaped() -> None:
    assert paragraph("see `<top>` 5 %") == "<p>see <code>&lt;top&gt;</code> 5&nbsp;%</p>"


def test_a_link_to_a_place_on_another_page_opens_it_there() -> None:
    assert link("a&b", "x/<y>.html", "cause-é") == '<a href="x/%3Cy%3E.html#at=cause-%C3%A9">a&amp;b</a>'
