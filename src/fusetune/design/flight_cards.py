"""Flight cards: which set to fly when, on paper, for those who fly every set instead of replaying it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from fusetune.design.flight_order import flight_order
from fusetune.design.study import load_study
from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.px4.parameters.params_file import read_params
from fusetune.storage.files import atomic_path

MOST_FLIGHTS = 400
_STUDIES = (".yaml", ".yml")


@dataclass(frozen=True)
class CardSet:
    """A set to fly: the file that is loaded, and the parameters in it."""

    name: str
    file: str
    parameters: Mapping[str, float]

    @property
    def needs_reboot(self) -> bool:
        """Whether something in it takes effect after a reboot only."""
        return any(PARAMETERS[name].reboot_required for name in self.parameters if name in PARAMETERS)


@dataclass(frozen=True)
class FlightCards:
    """The plan of a day: blocks of flights, each with every set once."""

    title: str
    sets: tuple[CardSet, ...]
    blocks: tuple[tuple[CardSet, ...], ...]
    seed: int

    @property
    def flights(self) -> int:
        """How many in all."""
        return len(self.sets) * len(self.blocks)

    @property
    def not_named_by_all(self) -> tuple[str, ...]:
        """Parameters that some sets give and others do not: they would keep the value of the flight before."""
        everywhere = {name for one in self.sets for name in one.parameters}
        return tuple(sorted(name for name in everywhere if any(name not in one.parameters for one in self.sets)))


def plan_cards(files: Sequence[str | os.PathLike[str]], flights: int, seed: int) -> FlightCards:
    """Plan at least so many flights, in whole blocks.

    Parameters
    ----------
    files : a study (`.yaml`), or parameter files (`.params`), a set each

    Raises
    ------
    UserError
        A file cannot be used, there are fewer than two sets, or too many flights.
    """
    paths = [Path(one) for one in files]
    title, sets = _sets(paths)
    if len(sets) < 2:
        raise UserError(paths[0], "holds one set, and one alone cannot be compared", "Name a study or more files")
    names = [one.name for one in sets]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise UserError(paths[0], f"two sets are called {twice!r}", "Give the files names of their own")
    if not 1 <= flights <= MOST_FLIGHTS:
        raise UserError("--flights", f"{flights} is not between 1 and {MOST_FLIGHTS}", "Plan a number of that kind")
    by_name = {one.name: one for one in sets}
    order = flight_order(names, -(-flights // len(sets)), seed)
    return FlightCards(title, tuple(sets), tuple(tuple(by_name[name] for name in block) for block in order), seed)


def _sets(paths: Sequence[Path]) -> tuple[str, list[CardSet]]:
    if paths[0].suffix.casefold() in _STUDIES:
        if len(paths) > 1:
            raise UserError(paths[1], "stands beside a study, which names all sets", "Name the study alone")
        study = load_study(paths[0])
        return study.name, [CardSet(one.name, f"{one.name}.params", one.overrides) for one in study.sets]
    found = []
    for path in paths:
        entries = read_params(path)
        if not entries:
            raise UserError(path, "holds no parameter", "Name parameter files with the values to fly")
        found.append(CardSet(path.stem, path.name, {one.name: float(one.value) for one in entries}))
    return f"{len(found)} sets", found


def write_cards(cards: FlightCards, path: str | os.PathLike[str]) -> None:
    """Write the cards as a page to print, A4 upright, in black on white.

    Raises
    ------
    UserError
        The file is to be anything but HTML.
    """
    if Path(path).suffix.casefold() not in (".html", ".htm"):
        raise UserError(
            path, "is no page", "Name a file that ends with .html, and print it from a browser, to PDF, too"
        )
    with atomic_path(path) as temporary:
        temporary.write_text(cards_page(cards), encoding="utf-8")


def cards_page(cards: FlightCards) -> str:
    """The page: what to do before, each flight a row to fill in, block by block."""
    rows, number = [], 0
    for index, block in enumerate(cards.blocks, start=1):
        rows.append(
            f'<tr class="block"><td colspan="9"><b>Block {index}</b> · date <span class="gap"></span> start '
            '<span class="gap short"></span> wind <span class="gap short"></span> same battery type, same mission'
            "</td></tr>"
        )
        for one in block:
            number += 1
            reboot = "☐" if one.needs_reboot else "–"
            rows.append(
                f'<tr><td class="number">{number}</td><td class="set"><b>{escape(one.name)}</b>'
                f'<small>{escape(one.file)}</small></td><td class="tick">☐</td><td class="tick">{reboot}</td>'
                '<td class="tick">☐</td><td></td><td></td><td></td><td></td></tr>'
            )
    head = ("#", "set: file to load", "loaded", "reboot", "10 s", "battery", "take-off", "log", "notes")
    titles = "".join(f"<th>{escape(one)}</th>" for one in head)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>Flight cards</title>'
        f"<style>{_STYLE}td {{ height: {_row_mm(cards):.1f}mm; }}</style></head>"
        f"<body><h1>Flight cards: {escape(cards.title)}</h1>"
        f"<p>{cards.flights} flights in blocks of {len(cards.sets)}, each block with every set "
        "once. Fly a block in one go and in this order: it is drawn so that battery, time of day and the flight before "
        "favour no set. A flight that fails is flown again at the end of its block. "
        f"Order drawn with seed {cards.seed}.</p>"
        f"<ul>{''.join(f'<li>☐ {escape(one)}</li>' for one in _checklist(cards))}</ul>"
        f"<table><colgroup>{_COLUMNS}</colgroup><thead><tr>{titles}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
        "</body></html>\n"
    )


def _checklist(cards: FlightCards) -> list[str]:
    lines = [
        "Before the first flight: save the parameters of the vehicle to a file, to go back to.",
        "Log whole: SDLOG_PROFILE with the bit “estimator replay” (bit 1) set, SDLOG_MODE 1 (from boot), reboot.",
        "Each flight: load the file of the set, reboot where the column asks for it, wait 10 s on the ground with "
        "GNSS, fly the same mission, land, write down battery, time and log.",
    ]
    missing = cards.not_named_by_all
    if missing:
        some = ", ".join(missing[:4]) + (f" and {len(missing) - 4} more" if len(missing) > 4 else "")
        lines.append(
            f"Load the saved parameters before each set: not all sets name {some}, which would stay as flown before."
        )
    return lines


def _row_mm(cards: FlightCards) -> float:
    """Height of a row that fills one page, within what can be written in and what is worth the paper."""
    return min(max(_ROWS_MM / (cards.flights + len(cards.blocks)), _LEAST_MM), _MOST_MM)


_ROWS_MM, _LEAST_MM, _MOST_MM = 230.0, 6.4, 11.0
_COLUMNS = "".join(f'<col style="width:{width}%">' for width in (4, 24, 7, 7, 6, 10, 10, 14, 18))
_STYLE = """@page { size: A4 portrait; margin: 11mm; }
* { box-sizing: border-box; } body { font: 11px/1.35 "Helvetica Neue", Arial, "DejaVu Sans", sans-serif; color: #000;
  background: #fff; max-width: 188mm; margin: 0 auto; }
h1 { font-size: 17px; margin: 0 0 4px; } p { margin: 0 0 4px; } ul { margin: 0 0 7px; padding: 0; list-style: none; }
li { padding-left: 15px; text-indent: -15px; margin: 1px 0; }
table { width: 100%; border-collapse: collapse; table-layout: fixed; }
th, td { border: 1px solid #000; padding: 0 4px; text-align: left; overflow: hidden; }
th { height: 6mm; font-size: 10px; border-width: 1px 1px 2px; } tr { break-inside: avoid; }
thead { display: table-header-group; }
td.number, td.tick { text-align: center; } td.tick { font-size: 17px; line-height: 1; } td.number { font-size: 13px; }
td.set { overflow-wrap: anywhere; line-height: 1.15; } td.set b { font-size: 12.5px; }
small { display: block; font-size: 8.5px; }
tr.block td { height: 6.4mm; border-top-width: 2px; background: #eee; break-after: avoid; }
.gap { display: inline-block; width: 30mm; border-bottom: 1px solid #000; } .gap.short { width: 17mm; }"""
