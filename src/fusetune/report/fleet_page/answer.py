"""The head of the fleet's page: how many flights show what, what changed, which flights to look at."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from html import escape

from fusetune.report.counted import count_words, listed
from fusetune.report.figure_words import figure_words
from fusetune.report.fleet_page.change_points import change_points
from fusetune.report.fleet_page.fleet_results import FleetResults
from fusetune.report.markup import bullets, number
from fusetune.report.severity_words import SEVERITY_WORDS, cause_words, worst_of

_NAMED_CAUSES = 4
_NAMED_CHANGES = 3


def fleet_answer(results: FleetResults) -> str:
    """The answer in a box."""
    severities = Counter(worst_of(flight["findings"]) for flight in results.flights)
    total = count_words(len(results.flights), "flight")
    if severities["fail"]:
        kind, title = "fail", f"{severities['fail']} of {total} show what must be mended before flying again"
    elif severities["warning"]:
        kind, title = "warning", f"{severities['warning']} of {total} show something to mend"
    elif troubled := sum(one["counts"]["fail"] > 0 for one in results.flights):
        kind, title = "warning", f"{troubled} of {total} have figures far beyond their limits"
    else:
        told = sum(not one["refused"] for one in results.flights)
        asked = total if told == len(results.flights) else f"{told} of {total}; the others cannot be replayed"
        kind, title = ("pass" if told else "warning"), f"No cause of trouble shows on {asked}"
    said = bullets([*_causes(results), *_unexplained(results), *_changes(results), *_outliers(results)])
    return f'<section class="decision is-{kind}"><h2>{escape(title)}</h2>{said}</section>'


def _causes(results: FleetResults) -> Iterator[str]:
    for cause in results.causes[:_NAMED_CAUSES]:
        words = cause_words(cause["id"])
        where = f" of {count_words(len(cause['vehicles']), 'vehicle')}" if len(cause["vehicles"]) > 1 else ""
        flights = cause["flights"]
        severity = SEVERITY_WORDS[cause["severity"]]
        found = f"{words[0].upper()}{words[1:]} ({severity}) on {count_words(len(flights), 'flight')}{where}"
        yield f"{found}: {listed(flights)}."
    more = len(results.causes) - _NAMED_CAUSES
    if more > 0:
        yield f"{count_words(more, 'more cause')}, in the table below."


def _unexplained(results: FleetResults) -> Iterator[str]:
    unknown = [
        one["name"] for one in results.flights if one["is_diagnosed"] and not one["findings"] and one["counts"]["fail"]
    ]
    if unknown:
        verb = "have" if len(unknown) != 1 else "has"
        yield f"{count_words(len(unknown), 'flight')} {verb} figures far beyond their limits that no known cause " \
              f"explains: {listed(unknown)}."  # fmt: skip
    silent = [one["name"] for one in results.flights if not one["is_diagnosed"]]
    if silent:
        yield f"{count_words(len(silent), 'log')} without a diagnosis, unreadable or too damaged: {listed(silent)}."
    less = [one["name"] for one in results.flights if one["is_diagnosed"] and one["refused"]]
    if less:
        yield f"{count_words(len(less), 'log')} that cannot be replayed, so less can be told: {listed(less)}."


def _changes(results: FleetResults) -> Iterator[str]:
    points = change_points(results)
    for point in points[:_NAMED_CHANGES]:
        one = point.changes[0]
        unit = f" {one['unit']}" if one["unit"] else ""
        before, after = number(one["before"]).text, number(one["after"]).text
        yield f"{point.in_words} {figure_words(one['id'])} was {before} before and is {after}{unit} since."
    more = len(points) - _NAMED_CHANGES
    if more > 0:
        yield f"{count_words(more, 'more change')}, below."
    if not points:
        yield "No figure of a vehicle changed over time beyond chance."


def _outliers(results: FleetResults) -> Iterator[str]:
    counted = Counter(one["flight"] for one in results.outliers)
    for flight, count in counted.most_common(1):
        yield f"{flight} stands out most from the flights of its vehicle, in {count_words(count, 'figure')}."
