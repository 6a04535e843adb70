"""The part of the page about which parameters matter on these flights."""

from __future__ import annotations

from fusetune.apply.sensitivity.result import FLAT, MATTERS, NOT_TOLD, UNSURE, ParameterSensitivity, Sensitivity
from fusetune.apply.sensitivity.wording import best_value
from fusetune.report.charts.sensitivity import sensitivity_chart
from fusetune.report.comparison import percent_change
from fusetune.report.markup import Cell, bullets, details, number, paragraph, section, table
from fusetune.report.results import Results

_DIGITS = 3
_VERDICTS = {MATTERS: "matters", UNSURE: "not sure", FLAT: "flat", NOT_TOLD: "not told by these sets"}


def sensitivity_section(results: Results) -> str:
    """In words, as a curve for each parameter, and as a table; empty where no flight has a say."""
    told = results.sensitivity
    if not results.flights:
        return ""
    title = "What matters"
    if told.found is None:
        return section(title, paragraph(told.sentences[0]), id="sensitivity")
    parts = [paragraph(told.sentences[0]), bullets(told.sentences[1:])]
    if any(one.curve is not None for one in told.found.parameters):
        parts.append(sensitivity_chart(told.found))
        parts.append(details("Figures of each parameter", _table(told.found)))
    return section(title, *parts, id="sensitivity")


def _table(found: Sensitivity) -> str:
    head = (
        "parameter",
        "now",
        "chosen",
        "",
        "errors change by up to %",
        "at most, as far as known %",
        "hardly change between",
        "best, as far as tried",
        "share of the change %",
        "together with others %",
    )
    rows = [_row(one) for verdict in _VERDICTS for one in found.of_verdict(verdict)]
    return table(
        head,
        rows,
        "Shares: Sobol indices over the neighbourhood, a factor of two (on linear scales a sixth of the range) around "
        "present and chosen values; in brackets the interval from redrawn flights",
    )


def _row(one: ParameterSensitivity) -> tuple[Cell | str, ...]:
    known = one.curve is not None
    return (
        Cell(one.parameter, "mono"),
        number(one.present, _DIGITS),
        number(one.incumbent, _DIGITS),
        Cell(_VERDICTS[one.verdict], "" if known else "quiet"),
        number(float(percent_change(one.change)), 2) if known else number(None),
        number(float(percent_change(one.possible)), 2) if one.possible is not None else number(None),
        _between(one.same_within),
        number(best_value(one), _DIGITS, "number quiet" if one.at_bound else "number") if known else number(None),
        _share(one.first, one.first_interval),
        _share(one.total, one.total_interval),
    )


def _between(ends: tuple[float, float] | None) -> Cell:
    return (
        Cell("–", "number quiet") if ends is None else Cell(f"{ends[0]:.{_DIGITS}g} … {ends[1]:.{_DIGITS}g}", "number")
    )


def _share(share: float | None, ends: tuple[float, float] | None) -> Cell:
    if share is None:
        return Cell("–", "number quiet")
    span = f" ({100.0 * ends[0]:.0f}–{100.0 * ends[1]:.0f})" if ends is not None else ""
    return Cell(f"{100.0 * share:.0f}{span}", "number")
