"""Which entries of a folder are logs, which are told of as refused, and how their flights are named."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.save.discovery import LONGEST_NAME_BYTES, Discovery, discover_logs, printable


def make(folder: Path, *names: str | bytes) -> None:
    for name in names:
        file = os.path.join(os.fsencode(folder), os.fsencode(name))
        os.makedirs(os.path.dirname(file), exist_ok=True)
        with open(file, "wb") as log:
            log.write(b"ULog")


def names(found: Discovery) -> list[str]:
    return [log.flight for log in found.logs]


def reasons(found: Discovery) -> dict[str, str]:
    return {entry.shown: entry.reason for entry in found.refused}


def test_flights_are_named_by_the_place_of_their_logs(tmp_path: Path) -> None:
    make(
        tmp_path, "a.ulg", "B.ULG", "sess001/log001.ulg", "log/sess002/log001.ulg", "card 2/log/2024-01-01/10_00_00.ulg"
    )
    make(tmp_path, "README.md", "a.ulg.txt", ".hidden.ulg", ".git/annex.ulg", "._a.ulg")
    found = discover_logs(tmp_path)
    assert names(found) == ["B", "a", "card 2_log_2024-01-01_10_00_00", "sess001_log001", "sess002_log001"]
    assert found.refused == ()
    assert {log.flight: log.shown for log in found.logs}["sess002_log001"] == "log/sess002/log001.ulg"


def test_a_log_that_is_added_leaves_the_names_of_the_others(tmp_path: Path) -> None:
    make(tmp_path, "log/sess001/log001.ulg", "x.ulg")
    before = names(discover_logs(tmp_path))
    make(tmp_path, "log/sess002/log001.ulg", "log001.ulg", "a/b/x.ulg", "log/sess001/log001/log001.ulg")
    assert set(before) < set(names(discover_logs(tmp_path)))


def test_names_that_meet_are_told_apart_by_a_digest_of_the_path(tmp_path: Path) -> None:
    make(
        tmp_path,
        "a_b.ulg",
        "a/b.ulg",
        "A_B.ulg",
        "cafe\u0301.ulg",
        "caf\u00e9.ulg",
        "flights.csv.ulg",
        "Delays.json.ulg",
        "present.json.ulg",
        "Flights.Parquet.ulg",
    )
    if len(os.listdir(tmp_path)) < 9:
        pytest.skip("this file system takes some of these names for the same")
    found = names(discover_logs(tmp_path))
    assert len({name.casefold() for name in found}) == 9
    assert "A_B" in found  # the first by name of those in the fewest folders
    assert not {"flights.csv", "flights.parquet", "present.json", "delays.json"} & {name.casefold() for name in found}
    assert "a_b_37053a" in found  # printf a/b.ulg | sha256sum


@pytest.mark.parametrize(
    ("file", "flight"),
    [
        ("{a}.ulg", "_a_"),
        ("new\nline.ulg", "new_line"),
        (b"\xff\xfe.ulg", "__"),
        ("con.ulg", "con_"),
        ("Aux.v2.ulg", "Aux_.v2"),
        ("back\\slash.ulg", "back_slash"),
        (" ends . .ulg", "ends"),
        ("right\u202eleft.ulg", "right_left"),
        ("-dash & (x) 'y' \"z\" $(id) \u65e5\u672c.ulg", "-dash & (x) 'y' \"z\" $(id) \u65e5\u672c"),
    ],
)
def test_names_are_kept_as_far_as_all_that_lies_behind_can_carry_them(
    tmp_path: Path, file: str | bytes, flight: str
) -> None:
    try:
        make(tmp_path, file)
    except OSError as error:
        pytest.skip(f"this file system does not take the name ({error.strerror})")
    (log,) = discover_logs(tmp_path).logs
    assert log.flight == flight
    assert Path(log.path).read_bytes() == b"ULog"
    log.shown.encode()
    assert log.shown.isprintable()


def test_long_names_are_cut_and_stay_apart(tmp_path: Path) -> None:
    make(tmp_path, "\u65e5" * 80 + "1.ulg", "\u65e5" * 80 + "2.ulg")
    found = names(discover_logs(tmp_path))
    assert len(set(found)) == 2
    assert all(len(name.encode()) <= LONGEST_NAME_BYTES + 7 for name in found)


def test_what_cannot_be_flown_is_refused_by_name(tmp_path: Path) -> None:
    make(tmp_path, "good.ulg", "packed.ulg.gz", "packed.ulg.ZIP", "folder.ulg/inner.ulg")
    (tmp_path / "dangling.ulg").symlink_to("/nowhere/b.ulg")
    (tmp_path / "itself.ulg").symlink_to("itself.ulg")
    (tmp_path / "linked.ulg").symlink_to("good.ulg")
    os.mkfifo(tmp_path / "pipe.ulg")
    with socket.socket(socket.AF_UNIX) as server:
        # the path of a socket must be short
        before = os.getcwd()
        os.chdir(tmp_path)
        server.bind("s.ulg")
        os.chdir(before)
    found = discover_logs(tmp_path)
    assert names(found) == ["folder.ulg_inner", "good", "linked"]
    told = reasons(found)
    assert told.keys() == {
        *("packed.ulg.gz", "packed.ulg.ZIP", "folder.ulg", "dangling.ulg", "itself.ulg", "pipe.ulg", "s.ulg")
    }
    assert told["dangling.ulg"] == "is a link to nothing (/nowhere/b.ulg)"
    assert "leads nowhere" in told["itself.ulg"]
    assert "compressed" in told["packed.ulg.gz"]
    assert "folder" in told["folder.ulg"]
    assert "pipe" in told["pipe.ulg"]
    assert all(entry.remedy for entry in found.refused)
    assert len({entry.flight for entry in found.refused} | set(names(found))) == 10


def test_folders_that_link_to_each_other_end(tmp_path: Path) -> None:
    make(tmp_path, "a/x.ulg", "elsewhere/y.ulg")
    (tmp_path / "a" / "up").symlink_to("..")
    (tmp_path / "0").symlink_to("a")
    flights = tmp_path / "a"
    (flights / "far").symlink_to(tmp_path / "elsewhere")
    assert names(discover_logs(tmp_path)) == ["a_x", "elsewhere_y"]
    assert "far_y" in names(discover_logs(flights))


def test_what_may_not_be_opened_is_refused(tmp_path: Path) -> None:
    make(tmp_path, "good.ulg", "secret.ulg", "closed/log.ulg")
    os.chmod(tmp_path / "secret.ulg", 0)
    os.chmod(tmp_path / "closed", 0)
    code = (
        "import os, sys; from fusetune.save.discovery import discover_logs\n"
        "if os.getuid() == 0: os.setgid(65534); os.setuid(65534)\n"
        "found = discover_logs(sys.argv[1])\n"
        "print([log.flight for log in found.logs], {entry.shown: entry.reason for entry in found.refused})"
    )
    for parent in (tmp_path, *tmp_path.parents):
        if parent.parent.is_relative_to(tempfile.gettempdir()):
            os.chmod(parent, 0o755)
    run = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=False)
    os.chmod(tmp_path / "closed", 0o755)
    assert run.stdout.strip() == (
        "['good'] {'closed': 'is a folder that cannot be opened (Permission denied)', "
        "'secret.ulg': 'cannot be opened (Permission denied)'}"
    ), run.stderr


def test_a_folder_that_is_none_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        discover_logs(tmp_path / "absent")


@settings(max_examples=50, deadline=None)
@given(st.lists(st.text(st.characters(blacklist_characters="/\0"), min_size=1, max_size=30), max_size=8))
def test_any_names_give_flights_that_differ_and_can_be_written(
    tmp_path_factory: pytest.TempPathFactory, stems: list[str]
) -> None:
    folder = tmp_path_factory.mktemp("flights")
    for stem in stems:
        with suppress(OSError, UnicodeEncodeError):  # longer than names can be; half of a surrogate pair
            (folder / f"{stem}.ulg").write_bytes(b"ULog")
    files = [file for file in os.listdir(folder) if not file.startswith(".")]
    found = names(discover_logs(folder))
    assert len({name.casefold() for name in found}) == len(files)
    for name in found:
        (folder / name).mkdir()
        assert not set(name) & set("{}/\n\0")


def test_printable_escapes_what_utf_8_and_one_line_cannot_hold() -> None:
    assert printable("a\nb\udcffc \u00e9") == "a\\x0ab\\xffc \u00e9"
