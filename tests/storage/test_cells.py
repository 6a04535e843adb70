"""No cell of a CSV file is a formula."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.storage.cells import as_it_was, harmless
from fusetune.storage.csv_file import write_csv

BEGINS = "=+-@\t\r\uff1d\uff0b\uff0d\uff20"
"""OWASP's list of what begins a formula, and the full-width forms of the first four (Unicode's halfwidth forms)."""


@pytest.mark.parametrize("begin", BEGINS)
@pytest.mark.parametrize("rest", ["cmd|'/C calc'!A0", "1+1", 'HYPERLINK("http://x")', "a\n=b", ""])
def test_no_cell_begins_a_formula(begin: str, rest: str) -> None:
    assert harmless(begin + rest).startswith("'")
    assert as_it_was(harmless(begin + rest)) == begin + rest


@pytest.mark.parametrize("text", ["a;=1+1", 'a"=1+1', "a\n=1+1", "a\r\n@x", "a,+x", "a\t-x"])
def test_no_part_of_a_cell_begins_one_either(text: str) -> None:
    """Programs that take another separator, or none of the quotes, see these parts as cells."""
    for part in re.split('[;,|"\t\r\n]', harmless(text)):
        assert not part.startswith(tuple(BEGINS))


@pytest.mark.parametrize("number", ["-1.5", "+2", "1e-9", "-3.", "-.5", "0", "-1E+05"])
def test_numbers_stay_numbers(number: str) -> None:
    assert harmless(number) == number


@pytest.mark.parametrize("text", ["log_10", "a - b", "x = 3, y -4", "PX4_FMU_V5", ""])
def test_plain_texts_stay_as_they_are(text: str) -> None:
    assert harmless(text) == text


@given(st.text(alphabet=st.sampled_from([*BEGINS, "'", '"', ";", ",", "\n", "a", "1", " "])))
def test_reading_gives_back_what_was_written(text: str) -> None:
    assert as_it_was(harmless(text)) == text


def test_written_tables_hold_no_formula_and_keep_their_numbers(tmp_path: Path) -> None:
    table = pa.table(
        {
            "flight": ["=1+1", "plain", None],
            "figure": [-1.5, 2.0, None],
            "count": pa.array([-3, 1, 2]),
            "kind": pa.array(["+x", "+x", "y"]).dictionary_encode(),
            "@name": [True, False, True],
        }
    )
    write_csv(tmp_path / "table.csv", table)
    with open(tmp_path / "table.csv", encoding="utf-8-sig", newline="") as file:
        rows = list(csv.DictReader(file))
    assert rows[0] == {"flight": "'=1+1", "figure": "-1.5", "count": "-3", "kind": "'+x", "'@name": "true"}
    assert [row["flight"] for row in rows] == ["'=1+1", "plain", ""]
