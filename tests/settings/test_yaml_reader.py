"""What is read of a YAML file, and the one sentence that ends every file that cannot be meant."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.errors import UserError
from fusetune.settings import yaml_reader
from fusetune.settings.yaml_reader import DEEPEST, MOST_BYTES, read_yaml


def message_of(path: Path) -> str:
    with pytest.raises(UserError) as error:
        read_yaml(path)
    message = str(error.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) < 700
    return message


def write(folder: Path, content: str | bytes) -> Path:
    path = folder / "a.yaml"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def bomb(levels: int, copies: int, form: str) -> str:
    """`copies` ** `levels` values in a few lines: "billion laughs" with lists, mappings or merge keys."""
    lines = ["a0: &a0 {k: 1}" if form != "list" else "a0: &a0 [1]"]
    for level in range(1, levels + 1):
        parts = [f"*a{level - 1}"] * copies
        if form == "list":
            lines.append(f"a{level}: &a{level} [{', '.join(parts)}]")
        elif form == "mapping":
            entries = ", ".join(f"k{number}: {part}" for number, part in enumerate(parts))
            lines.append(f"a{level}: &a{level} {{{entries}}}")
        else:
            lines.append(f"a{level}: &a{level} {{<<: [{', '.join(parts)}]}}")
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("-2", -2),
        ("0", 0),
        ("0.5", 0.5),
        ("0x1F", 31),
        ("1_000", 1000),
        ("2024-05-06", "2024-05-06"),
        ("'010'", "010"),
        ('"1:30"', "1:30"),
        ("true", True),
    ],
)
def test_values_are_what_they_look_like(tmp_path: Path, text: str, value: object) -> None:
    read = read_yaml(write(tmp_path, f"a: {text}"))["a"]
    assert read == value
    assert type(read) is type(value)


def test_parts_may_be_repeated_by_name(tmp_path: Path) -> None:
    assert read_yaml(write(tmp_path, "a: &x {b: 1}\nc: *x\nd: {<<: *x, e: 2}")) == {
        "a": {"b": 1},
        "c": {"b": 1},
        "d": {"b": 1, "e": 2},
    }


def test_a_byte_order_mark_is_no_part_of_the_first_key(tmp_path: Path) -> None:
    assert read_yaml(write(tmp_path, "\ufeffa: 1")) == {"a": 1}


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        ("", ("top level is empty",)),
        ("# nothing\n", ("top level is empty",)),
        ("- 1\n", ("top level is a list",)),
        ("a: 1\n---\nb: 2\n", ("line 2", "document")),
        ("a: 1\nb: 2\na: 3\n", ("'a' stands twice, in lines 1 and 3", "Keep one")),
        ("a: {b: 1, b: 2}\n", ("'b' stands twice",)),
        ("1: x\n", ("line 1", "'1' is no text", "quotes")),
        ("a: 1\non: x\n", ("line 2", "'on' is no text (bool)", "quotes")),
        ("? [a]\n: 1\n", ("line 1", "no text", "quotes")),
        ("a: 010\n", ("line 1", "'010'", "base 8", "leading zeros")),
        ("a:\n  - -0_7\n", ("line 2", "'-0_7'", "base 8")),
        ("a: 1:30\n", ("line 1", "'1:30'", "base 60", "in full")),
        ("a: 1:30.5\n", ("line 1", "base 60")),
        (f"a: {'9' * 5000}\n", ("line 1", "no usable number")),
        ('a: !!int ""\n', ("line 1", "no usable number")),
        ('a: !!float "x"\n', ("line 1", "no usable number")),
        ("a: !!python/object/apply:os.system [ls]\n", ("not valid YAML", "line 1")),
        ('a: !!timestamp "x"\n', ("tag",)),
        ("a:\n\t- 1\n", ("not valid YAML", "line 2")),
        ("a: [1, 2\n", ("not valid YAML", "line 2")),
        ("a: *b\n", ("not valid YAML", "line 1")),
        ("a: &a [*a]\n", ("line 1", "repeats itself")),
        ("a: \x00\n", ("U+0000", "line 1")),
        (b"a: \xff\n", ("UTF-8", "byte 3")),
        ("a: 1".encode("utf-16"), ("UTF-8",)),
        ("a: " + "[" * (DEEPEST + 1) + "]" * (DEEPEST + 1), ("line 1", f"more than {DEEPEST} deep")),
        ("[" * 100_000, ("deep",)),
        ("- " * 100_000, ("deep",)),
        ("{a: " * 50_000, ("deep",)),
        ("? " * 100_000, ("deep",)),
        ("a: " + "x" * MOST_BYTES, ("larger than 500 kB",)),
        (bomb(8, 10, "list"), ("values",)),
        (bomb(8, 10, "mapping"), ("values",)),
        (bomb(8, 10, "merge"), ("values",)),
        (bomb(2 * DEEPEST, 1, "list"), ("deep",)),
    ],
)
def test_what_cannot_be_meant_ends_in_one_sentence(
    tmp_path: Path, content: str | bytes, parts: tuple[str, ...]
) -> None:
    message = message_of(write(tmp_path, content))
    for part in parts:
        assert part in message


def test_a_file_of_too_many_values_ends_in_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml_reader, "MOST_VALUES", 20)
    assert read_yaml(write(tmp_path, f"a: [{', '.join('1' * 17)}]"))["a"] == [1] * 17
    assert "more than 20 values" in message_of(write(tmp_path, f"a: [{', '.join('1' * 20)}]"))


def test_what_is_no_file_ends_in_one_sentence(tmp_path: Path) -> None:
    assert "No such file" in message_of(tmp_path / "none.yaml")
    assert "no regular file" in message_of(tmp_path)
    os.mkfifo(tmp_path / "pipe.yaml")
    assert "no regular file" in message_of(tmp_path / "pipe.yaml")
    with pytest.raises(UserError, match="null"):
        read_yaml("a\0.yaml")


@settings(max_examples=60, deadline=None)
@given(content=st.binary(max_size=60) | st.text(alphabet="abk01:?-&*<!|>{}[],#'\" \n\t.e", max_size=60).map(str.encode))
def test_no_bytes_raise_anything_else(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "any.yaml"
    path.write_bytes(content)
    with suppress(UserError):
        assert isinstance(read_yaml(path), dict)
