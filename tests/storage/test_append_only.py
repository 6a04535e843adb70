"""A file that is only ever added to."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fusetune.errors import UserError
from fusetune.storage.append_only import append, read_lines


def numbers(file: Path) -> list[int]:
    return [line.content["number"] for line in read_lines(file)]


def test_lines_come_back_in_order_and_the_same_one_is_added_once(tmp_path: Path) -> None:
    file = tmp_path / "below" / "a.jsonl"
    assert read_lines(file) == []
    assert [append(file, {"number": number}, {"written": str(number)}) for number in (1, 2, 1)] == [True, True, False]
    assert append(file, {"number": 2}, {"written": "later"}) is False
    assert numbers(file) == [1, 2]
    assert [line.content["written"] for line in read_lines(file)] == ["1", "2"]


def test_what_was_written_is_never_touched_again(tmp_path: Path) -> None:
    file = tmp_path / "a.jsonl"
    before = b""
    for number in range(5):
        append(file, {"number": number})
        now = file.read_bytes()
        assert now.startswith(before)
        before = now


@settings(deadline=None, max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_is_told_with_its_line(tmp_path: Path, place: float, bit: int) -> None:
    file = tmp_path / "a.jsonl"
    file.unlink(missing_ok=True)
    for number in range(3):
        append(file, {"number": number, "text": "a\nb"})
    content = bytearray(file.read_bytes())
    # the last two bytes say that the last line is whole: without them it is one that was never finished
    at = int(place * (len(content) - 3))
    content[at] ^= 1 << bit
    file.write_bytes(content)
    with pytest.raises(UserError, match=r"line \d+ is not what was written"):
        read_lines(file)
    with pytest.raises(UserError, match="is not what was written"):
        append(file, {"number": 9})
    assert file.read_bytes() == bytes(content)


@pytest.mark.parametrize("change", ["swapped", "left out", "put in twice"])
def test_whole_lines_that_were_moved_are_told(tmp_path: Path, change: str) -> None:
    file = tmp_path / "a.jsonl"
    for number in range(4):
        append(file, {"number": number})
    lines = file.read_bytes().splitlines(keepends=True)
    orders = {"swapped": [0, 2, 1, 3], "left out": [0, 2, 3], "put in twice": [0, 1, 1, 2, 3]}
    file.write_bytes(b"".join(lines[number] for number in orders[change]))
    with pytest.raises(UserError, match="does not follow the one before"):
        read_lines(file)


def test_a_line_that_was_cut_at_any_byte_is_passed_over_and_added_again(tmp_path: Path) -> None:
    file = tmp_path / "a.jsonl"
    append(file, {"number": 1})
    first = len(file.read_bytes())
    append(file, {"number": 2})
    whole = file.read_bytes()
    for cut in range(first, len(whole)):
        file.write_bytes(whole[:cut])
        # all but its end of line is the whole line
        assert numbers(file) == ([1, 2] if cut == len(whole) - 1 else [1])
        append(file, {"number": 2})
        append(file, {"number": 3})
        assert numbers(file) == [1, 2, 3]
        assert file.read_bytes().startswith(whole[:cut])


def test_killed_writers_lose_nothing_and_leave_nothing_broken(tmp_path: Path) -> None:
    file = tmp_path / "a.jsonl"
    program = (
        "import itertools, sys; from fusetune.storage.append_only import append\n"
        "for n in itertools.count(): append(sys.argv[1], {'number': n, 'text': 'x' * 20000}); print(n, flush=True)"
    )
    told = 0
    for patience_s in (0.05, 0.11, 0.02):
        writer = subprocess.Popen([sys.executable, "-c", program, str(file)], stdout=subprocess.PIPE, text=True)
        assert writer.stdout is not None
        writer.stdout.readline()
        time.sleep(patience_s)
        writer.send_signal(signal.SIGKILL)
        told = max([told, *(int(line) for line in writer.stdout.read().split())])
        writer.wait()
        found = numbers(file)
        assert found == list(range(len(found)))
        assert len(found) > told
