from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.flipped_bits import with_flipped_bits

from fusetune.errors import UserError
from fusetune.storage.documents import read_as, read_document, write_document

DOCUMENT = {"flight": "höhe 7", "grade": "B", "figures": [1.5, None, 1e-300], "deep": {"b": {}, "a": [{}]}}
JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda part: st.lists(part, max_size=3) | st.dictionaries(st.text(), part, max_size=3),
    max_leaves=6,
)


@pytest.mark.parametrize("form", [{}, {"lines": 1}, {"lines": 2, "sort_keys": True}, {"sort_keys": True}])
def test_what_was_written_is_read_and_is_plain_json(tmp_path: Path, form: dict[str, bool]) -> None:
    file = tmp_path / "a.json"
    write_document(file, DOCUMENT, **form)
    assert read_document(file) == DOCUMENT
    plain = json.loads(file.read_text(encoding="utf-8"))
    assert len(plain.pop("digest")) == 64
    assert plain == DOCUMENT


@settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
@given(document=st.dictionaries(st.text().filter(lambda key: key != "digest"), JSON_VALUES, min_size=1, max_size=3))
def test_any_document_comes_back(tmp_path_factory: pytest.TempPathFactory, document: dict[str, Any]) -> None:
    file = tmp_path_factory.getbasetemp() / "any.json"
    for lines in (False, True):
        write_document(file, document, lines=lines)
        assert read_document(file) == document


def test_a_name_that_is_no_text_comes_back(tmp_path: Path) -> None:
    """Python gives bytes of a file name that are no UTF-8 as lone surrogates (PEP 383)."""
    write_document(tmp_path / "a.json", {"flight": "caf\udce9"})
    assert read_document(tmp_path / "a.json") == {"flight": "caf\udce9"}


def test_every_single_bit_that_flips_is_found(tmp_path: Path) -> None:
    file, flipped = tmp_path / "a.json", tmp_path / "flipped.json"
    write_document(file, {"grade": "B", "é": 1e-300})
    for damaged in with_flipped_bits(file.read_bytes()):
        flipped.write_bytes(damaged)
        with pytest.raises(UserError, match=r"flipped\.json.*Delete it and run the pipeline again"):
            read_document(flipped)


def test_where_the_digest_may_be_missing_a_flipped_bit_is_found_or_changes_no_entry(tmp_path: Path) -> None:
    file, flipped, document = tmp_path / "a.json", tmp_path / "flipped.json", {"grade": "B", "é": 1e-300}
    write_document(file, document)
    for damaged in with_flipped_bits(file.read_bytes()):
        flipped.write_bytes(damaged)
        with suppress(UserError):
            read = read_document(flipped, sealed=False)
            assert {key: read[key] for key in document} == document


def test_a_file_that_was_cut_or_is_missing_is_named(tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    with pytest.raises(UserError, match=r"a\.json: cannot be read: No such file"):
        read_document(file)
    write_document(file, DOCUMENT)
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(UserError, match=r"a\.json: is cut or damaged"):
        read_document(file)


@pytest.mark.parametrize("content", ["", "[]", "{", '{"a": 1}', "\x00", "[" * 100_000])
def test_a_document_of_another_program(tmp_path: Path, content: str) -> None:
    file = tmp_path / "a.json"
    file.write_text(content)
    with pytest.raises(UserError, match=r"a\.json"):
        read_document(file)
    if content == '{"a": 1}':
        assert read_document(file, sealed=False) == {"a": 1}
    else:
        with pytest.raises(UserError, match=r"a\.json"):
            read_document(file, sealed=False)


def test_the_digest_is_no_entry_of_the_document(tmp_path: Path) -> None:
    for document in ({}, {"digest": 1}):
        with pytest.raises(ValueError, match="digest"):
            write_document(tmp_path / "a.json", document)


def test_a_document_of_something_else_is_told_by_what_it_lacks(tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    write_document(file, {"figures": [2, 3]})
    assert read_as(file, lambda document: sum(document["figures"]), "how many there are") == 5
    with pytest.raises(UserError, match=r"a\.json: does not say how many there are \('number'\)"):
        read_as(file, lambda document: document["number"], "how many there are")
