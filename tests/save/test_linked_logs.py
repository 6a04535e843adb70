"""Logs of a command line, linked into the folder of flights."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fusetune.errors import UserError
from fusetune.save.discovery import discover_logs
from fusetune.save.linked_logs import LinkedLogs, link_logs


def log(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(str(path).encode())
    return path


def contents(flights: Path) -> dict[str, bytes]:
    return {one.flight: Path(one.path).read_bytes() for one in discover_logs(flights).logs}


def test_logs_of_one_name_are_each_a_flight_and_a_second_time_changes_nothing(tmp_path: Path) -> None:
    logs = [log(tmp_path / day / "log_1.ulg") for day in ("monday", "tuesday")]
    # a log of another place with the same last folder
    logs.append(log(tmp_path / "b" / "tuesday" / "log_1.ulg"))
    flights = tmp_path / "work" / "flights"
    assert link_logs(logs, flights) == LinkedLogs(linked=3, there=0, others=0)
    first = contents(flights)
    assert sorted(first.values()) == sorted(one.read_bytes() for one in logs)
    assert {"log_1", "tuesday_log_1"} < first.keys()
    assert link_logs(logs[::-1], flights) == LinkedLogs(linked=0, there=3, others=0)
    assert contents(flights) == first


def test_what_lies_there_already_stays_and_is_told_of(tmp_path: Path) -> None:
    flights = tmp_path / "flights"
    inside, other = log(flights / "inside.ulg"), log(flights / "sess" / "other.ulg")
    outside = log(tmp_path / "inside.ulg")
    assert link_logs([inside, outside], flights) == LinkedLogs(linked=1, there=1, others=1)
    assert sorted(contents(flights).values()) == sorted(one.read_bytes() for one in (inside, other, outside))
    assert not inside.is_symlink()


def test_a_folder_is_one_link_and_its_new_logs_come_along(tmp_path: Path) -> None:
    card, flights = tmp_path / "card" / "log", tmp_path / "flights"
    log(card / "sess001" / "log001.ulg")
    assert link_logs([card], flights).linked == 1
    log(card / "sess002" / "log001.ulg")
    assert contents(flights).keys() == {"sess001_log001", "sess002_log001"}


def test_a_log_without_the_suffix_is_a_log_as_it_was_named_as_one(tmp_path: Path) -> None:
    link_logs([log(tmp_path / "download")], tmp_path / "flights")
    assert contents(tmp_path / "flights").keys() == {"download"}


@pytest.mark.parametrize(("name", "said"), [("none.ulg", "does not exist"), ("empty", "holds no log")])
def test_with_one_that_cannot_be_meant_nothing_is_linked(name: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(UserError, match=said):
        link_logs([log(tmp_path / "good.ulg"), tmp_path / name], tmp_path / "flights")
    assert not (tmp_path / "flights").exists()


def test_where_links_cannot_be_made_the_remedy_is_a_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*given: object, **also: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "symlink", refuse)
    with pytest.raises(UserError, match="Copy the logs into"):
        link_logs([log(tmp_path / "one.ulg")], tmp_path / "flights")
