"""What a long command tells, on a terminal and into a file."""

from __future__ import annotations

import os

import pytest

from fusetune.apply.search.progress import ProgressLine
from fusetune.cli.lines import Lines

SENTENCE = "A sentence that is too long for a line of a terminal, and so goes on in the next one of it."


def tell() -> None:
    lines = Lines()
    lines.tell("saving 2 logs")
    lines.tell(ProgressLine("round 1 of 9: a line that is longer than the terminal is wide"))
    lines.tell(ProgressLine("round 2"))
    lines.tell(SENTENCE)
    lines.tell("  in   columns")
    lines.tell_below("    why: its end stands to the right of where it begins")
    lines.tell(ProgressLine("round 3"))
    lines.end()


def test_into_a_file_every_line_stands_by_itself(capsys: pytest.CaptureFixture[str]) -> None:
    tell()
    assert capsys.readouterr().out.splitlines() == [
        "saving 2 logs",
        "round 1 of 9: a line that is longer than the terminal is wide",
        "round 2",
        SENTENCE,
        "  in   columns",
        "    why: its end stands to the right of where it begins",
        "round 3",
    ]


def test_on_a_terminal_progress_takes_the_place_of_what_was_before(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setattr("shutil.get_terminal_size", lambda *_, **__: os.terminal_size((40, 24)))
    tell()
    shown: list[str] = []
    for line in capsys.readouterr().out.split("\n"):
        # what a terminal shows of a line: what stands behind the last return that cleared it
        shown.append(line.rpartition("\r\x1b[K")[2])
    assert shown == [
        "saving 2 logs",
        "A sentence that is too long for a line",
        "of a terminal, and so goes on in the",
        "next one of it.",
        "  in   columns",
        "    why: its end stands to the right of",
        "      where it begins",
        "round 3",
        "",
    ]
