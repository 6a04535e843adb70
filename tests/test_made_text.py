from __future__ import annotations

from pathlib import Path

import pytest
from tests.made_text import OutOfDateError, UpToDate, compare

PAGE = "# Page\n\n<!-- made:table, renewed by pytest --update -->\n| a |\n<!-- /made:table -->\n\nmore\n"


@pytest.fixture
def page(tmp_path: Path) -> Path:
    file = tmp_path / "page.md"
    file.write_text(PAGE, encoding="utf-8")
    return file


def test_a_block_that_is_up_to_date_is_left_alone(page: Path, up_to_date: UpToDate) -> None:
    before = page.stat()
    for text in ("| a |", "| a |\n"):
        up_to_date(page, "table", text)
    compare(page, "table", "| a |", "renew", update=True)
    assert page.stat() == before


def test_of_a_block_that_is_not_the_difference_and_the_remedy_are_told(page: Path) -> None:
    with pytest.raises(OutOfDateError) as caught:
        compare(page, "table", "| b |", "pytest this --update", update=False)
    said = str(caught.value).splitlines()
    assert said[:2] == ["'table' in page.md is out of date; renew it with", "  pytest this --update"]
    assert said[-2:] == ["-| a |", "+| b |"]
    assert page.read_text(encoding="utf-8") == PAGE


@pytest.mark.parametrize("text", ["| b |\n| c |", "| /x made: é |", "", "\\1 \\g<0>"])
def test_update_writes_the_block_and_nothing_else(page: Path, text: str) -> None:
    compare(page, "table", text, "renew", update=True)
    assert page.read_text(encoding="utf-8") == PAGE.replace("| a |", text)
    compare(page, "table", text, "renew", update=False)


def test_a_whole_file_is_made_where_there_is_none(tmp_path: Path) -> None:
    file = tmp_path / "schema.yaml"
    with pytest.raises(OutOfDateError, match=r"^schema\.yaml is out of date"):
        compare(file, None, "a: 1", "renew", update=False)
    compare(file, None, "a: 1", "renew", update=True)
    assert file.read_text(encoding="utf-8") == "a: 1\n"


def test_the_comments_may_be_of_any_kind_and_names_may_begin_alike(tmp_path: Path) -> None:
    file = tmp_path / "config.yaml"
    file.write_text("# made:a\n1\n# /made:a\n# made:a-b\n2\n# /made:a-b\n", encoding="utf-8")
    compare(file, "a", "3", "renew", update=True)
    assert file.read_text(encoding="utf-8") == "# made:a\n3\n# /made:a\n# made:a-b\n2\n# /made:a-b\n"


@pytest.mark.parametrize(
    "content",
    ["", "<!-- made:table -->\n", "<!-- /made:table -->\n<!-- made:table -->\n", PAGE + PAGE, PAGE + "made:table\n"],
)
def test_markers_that_are_missing_doubled_or_in_the_wrong_order_are_told(page: Path, content: str) -> None:
    page.write_text(content, encoding="utf-8")
    with pytest.raises(ValueError, match="needs one line with 'made:table'"):
        compare(page, "table", "x", "renew", update=True)
    assert page.read_text(encoding="utf-8") == content
