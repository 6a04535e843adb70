"""`fusetune compare`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.cli.command import DONE
from fusetune.cli.output.json_document import add_json, print_document

if TYPE_CHECKING:
    from fusetune.apply.compared_results import ComparedResults

HELP = "tell what two folders of results differ in: decision, ranking, scores, parameters"
EXAMPLES = (
    ("fusetune compare before/results after/results", "say of two runs, or of two releases on the same logs"),
    ("fusetune compare a b --json | jq .same_decision", "for a script"),
)
DIFFER = 1
"""Exit status where decision or figures differ."""

_MOST_ROWS = 20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The two folders."""
    parser.add_argument("a", type=Path, metavar="A", help="folder results of a run")
    parser.add_argument("b", type=Path, metavar="B", help="another")
    parser.add_argument("--all", action="store_true", help=f"all flights and sets, not only the {_MOST_ROWS} farthest")
    add_json(parser)
    parser.epilog = "Exit status: 0 decision and figures are the same; 1 they differ; 2 one cannot be read."


def run(options: argparse.Namespace) -> int:
    """Compare and tell; `DONE` where nothing differs, else `DIFFER`."""
    from fusetune.apply.compared_results import compare_results
    from fusetune.apply.results_folder import results_folder

    found = compare_results(results_folder(options.a), results_folder(options.b))
    if options.json:
        print_document(found.document())
    else:
        from fusetune.cli.lines import Lines

        lines = Lines()
        for line in _lines(found, most=None if options.all else _MOST_ROWS):
            lines.tell(line)
    return DONE if found.are_equal else DIFFER


def _lines(found: ComparedResults, most: int | None) -> Iterator[str]:
    from fusetune.apply.wording import named

    yield f"The decision is {'the same' if found.same_decision else 'another'}."
    for letter, one in (("A", found.a), ("B", found.b)):
        yield f"{letter}  {one['folder']}, {one['product']}: {one['sentence']}"
    if found.are_equal:
        yield f"All figures are the same: {len(found.flights)} flights, {len(found.sets)} sets."
        return
    yield from _parameters(found)
    yield from _sets(found, most)
    yield from _flights(found, most)
    for letter, names in (("A", found.only_a), ("B", found.only_b)):
        if names:
            yield f"Only in {letter}: {', '.join(names) if most is None else named(names)}"
    for name, (one, other) in found.settings.items():
        yield f"Setting {name}: {_shown(one)} → {_shown(other)}"
    if found.files:
        yield f"Configuration files that differ: {', '.join(found.files)}"


def _parameters(found: ComparedResults) -> Iterator[str]:
    from fusetune.cli.output.tables import table_lines

    rows = [[name, _value(one), _value(other)] for name, (one, other) in found.parameters.items() if one != other]
    if rows:
        yield "Parameters to load (– is left as it flies)"
        yield from table_lines([["", "A", "B"], *rows], right=(1, 2), indent=" ")


def _sets(found: ComparedResults, most: int | None) -> Iterator[str]:
    from fusetune.cli.output.tables import percent, table_lines

    rows = []
    for one in found.sets:
        known = one.a_percent is not None and one.b_percent is not None
        apart = (one.b_percent or 0.0) - (one.a_percent or 0.0) if known else None
        same = one.a_status == one.b_status and one.a_rank == one.b_rank and known and abs(apart or 0.0) < 5e-5
        if not same:
            status = one.a_status if one.a_status == one.b_status else f"{one.a_status} → {one.b_status}"
            rank = f"{one.a_rank or '–'} → {one.b_rank or '–'}"
            values = [percent(one.a_percent), percent(one.b_percent), percent(apart, digits=4 if most is None else 2)]
            rows.append((abs(apart or 0.0), [one.name, *values, rank, status]))
    if not rows:
        yield f"Ranking: the same for all {len(found.sets)} sets."
        return
    yield f"Ranking, change of the prediction error: {len(rows)} of {len(found.sets)} sets differ"
    shown = [row for _, row in sorted(rows, key=lambda one: -one[0])[:most]]
    yield from table_lines([["set", "A", "B", "B − A", "rank", "status"], *shown], right=(1, 2, 3), indent=" ")
    yield from _more(len(rows), len(shown))


def _flights(found: ComparedResults, most: int | None) -> Iterator[str]:
    from fusetune.cli.output.tables import percent, table_lines

    rows = []
    for one in found.flights:
        size = abs(one.largest_percent or 0.0)
        notes = [] if one.same_log else ["other log of that name"]
        notes += [] if one.a_counts == one.b_counts else ["counts in A alone" if one.a_counts else "counts in B alone"]
        if notes or size >= 5e-5:
            rows.append((size, [one.flight, percent(one.largest_percent, digits=4), one.of_set, "; ".join(notes)]))
    if not found.flights:
        yield "Scores: no flight is in both."
        return
    if not rows:
        yield f"Scores: the same on all {len(found.flights)} flights that both have."
        return
    yield f"Scores, largest difference of the prediction error: {len(rows)} of {len(found.flights)} flights differ"
    shown = [row for _, row in sorted(rows, key=lambda one: -one[0])[:most]]
    yield from table_lines([["flight", "B − A", "of set", ""], *shown], right=(1,), indent=" ")
    yield from _more(len(rows), len(shown))


def _more(there: int, shown: int) -> Iterator[str]:
    if there > shown:
        yield f" … and {there - shown} more (--all)"


def _value(value: float | None) -> str:
    return "–" if value is None else f"{value:.6g}"


def _shown(value: Any) -> str:
    return "not there" if value is None else str(value)
