"""Short names of flights: what tells them apart, without owner, date and what all have in common."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import takewhile
from typing import Any

LONGEST = 20
"""Characters of a short name."""

_DATE = re.compile(r"[-_ ]*\d{4}-\d{1,2}-\d{1,2}(?:[-_ T]\d{1,2}[-:]\d{1,2}(?:[-:]\d{1,2})?)?Z?")
_WORD_BEGINS = re.compile(r"(?<=[-_ .])")
_DIGITS = re.compile(r"(\d+)")


def short_names(flights: Iterable[str]) -> dict[str, str]:
    """Short name of each flight; no two are alike.

    Of `SkyRats__log_8_2021-8-12-15-53-14` it is `log_8`. Where two would be alike without owner or date they keep it,
    but for a flight of the owner who has most; what is still long loses what all begin with, then its middle.
    """
    names = list(dict.fromkeys(flights))
    short = {name: name for name in names}
    for shorten in (_without_date, _without_owner):
        shorter = {name: shorten(one) or one for name, one in short.items()}
        short = {name: shorter[name] if _may_have(name, shorter) else short[name] for name in names}
    common = _common_start([one for one in short.values() if len(one) > LONGEST])
    told: dict[str, str] = {}
    taken: set[str] = set()
    for name, one in short.items():
        told[name] = _fitted(one, common, taken)
        taken.add(told[name])
    return told


def _may_have(name: str, short: Mapping[str, str]) -> bool:
    """Whether a flight may have its short name: no other of as frequent an owner would have the same."""
    rivals = [one for one, words in short.items() if words == short[name] and one != name]
    if not rivals:
        return True
    flights = Counter(map(_owner, short))
    return bool(_owner(name)) and all(flights[_owner(name)] > flights[_owner(one)] for one in rivals)


def _owner(name: str) -> str:
    before, between, _ = name.partition("__")
    return before if between else ""


def _without_date(name: str) -> str:
    return _DATE.sub("", name).strip("-_ ")


def _without_owner(name: str) -> str:
    return name.partition("__")[2] or name


def _common_start(names: list[str]) -> int:
    """How many characters all of several names begin with, up to the beginning of a word."""
    columns = zip(*names, strict=False) if len(names) > 1 else ()
    shared = sum(1 for _ in takewhile(lambda letters: len(set(letters)) == 1, columns))
    return (
        max((match.start() for match in _WORD_BEGINS.finditer(names[0]) if match.start() <= shared), default=0)
        if (shared)
        else 0
    )


def _fitted(name: str, common: int, taken: set[str]) -> str:
    if len(name) > LONGEST:
        name = name[common:]
    if len(name) > LONGEST:
        begin = (LONGEST - 1) * 2 // 3
        name = f"{name[:begin]}…{name[begin + 1 - LONGEST :]}"
    one, count = name, 1
    while one in taken:
        count += 1
        one = f"{name[: LONGEST - 3]}…{count}"
    return one


def natural(name: str) -> tuple[tuple[int, str], ...]:
    """By which `flight_10` stands after `flight_9`."""
    return tuple((int(part), "") if part.isdigit() else (-1, part) for part in _DIGITS.split(name) if part)


def in_time_order(rows: Iterable[Mapping[Any, Any]]) -> list[str]:
    """Names of flights, the oldest first, those whose log tells no time last.

    Parameters
    ----------
    rows : of `results/save/flights.parquet`: `flight` and `recorded`
    """

    def order(row: Mapping[Any, Any]) -> tuple[bool, str, tuple[tuple[int, str], ...]]:
        recorded = str(row.get("recorded") or "")
        return not recorded, recorded, natural(str(row["flight"]))

    return [str(row["flight"]) for row in sorted(rows, key=order)]
