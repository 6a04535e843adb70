"""Tables of the ranking: figures of each set, signs per flight, reasons against sets, all other criteria."""

import math
from collections.abc import Hashable, Mapping, Sequence
from html import escape
from typing import Any

from fusetune.apply.ranking import PRESENT, SAME
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.report.charts.set_looks import set_class, set_marker
from fusetune.report.comparison import AIM_WORDS, flight_changes, percent_change, told_aims
from fusetune.report.counted import count_words
from fusetune.report.markup import Cell, CellLike, Html, details, number, signed, table
from fusetune.report.results import OUT, Results

_MOST_REASONS = 4
NOT_KNOWN = "not known"


def set_name(name: str, results: Results) -> Html:
    """A set's name with its marker, set off if it is the one to fly."""
    kind = "short best" if name == results.decision["chosen"] else "short"
    return Html(f'<span class="set-name">{marker_sign(results, name)}{escape(name)}</span>', kind)


def marker_sign(results: Results, name: str) -> str:
    """The marker of a set as a picture beside its name; empty of one that has none."""
    if name not in results.styles:
        return ""
    drawn = f'<g class="{set_class(results, name)}">{set_marker(results, name, 6.0, 6.0, 5.0)}</g>'
    return f'<svg class="chart-sign chart" viewBox="0 0 12 12" aria-hidden="true">{drawn}</svg>'


def confidence_of(results: Results) -> str:
    """Level of the intervals, as `95 %`."""
    return f"{100.0 * results.decision['rule']['confidence']:g} %"


def ranking_table(results: Results) -> str:
    """Score, differences and intervals, probabilities."""
    aims = told_aims(results)
    corrected = "p_holm" if results.decision["rule"]["multiplicity"] == "holm" else "p_family"
    if corrected not in results.ranking:
        corrected = "p_holm"
    head = ("set", "", "change %", "interval %", *(f"{aim} %" for aim in aims), "better on", "p", "P(best)")
    rows: list[tuple[CellLike, ...]] = []
    for one in results.ranking.to_dict("records"):
        # of what is as the present one there is nothing to say
        is_present = one["status"] in (PRESENT, SAME)
        rows.append(
            (
                set_name(one["name"], results),
                _status(one),
                signed(None if is_present else _percent(one["difference"])),
                _interval(one, is_present),
                *(signed(None if is_present else _percent(one[f"{aim}_difference"])) for aim in aims),
                _better_on(one, is_present),
                _probability(None if is_present else one[corrected], is_present),
                Cell("–", "number quiet") if one["status"] == SAME else _share(one["p_best"]),
            )
        )
    note = (
        "change: of the prediction error against the present set, by the score that decides and in each way of "
        "predicting; below 0 is better. p: how often chance would show such a difference, with all sets in the "
        "running. P(best): share of redrawn studies in which no eligible set does better. –: so few flights do not "
        "show it."
    )
    return table(head, rows, footer=note)


def interval_text(lower: float | None, upper: float | None) -> str:
    """Ends of an interval of score differences, in percent; "not known" where there is none."""
    if lower is None or upper is None or not (math.isfinite(lower) and math.isfinite(upper)):
        return NOT_KNOWN
    return f"{signed(_percent(lower)).text} to {signed(_percent(upper)).text}"


def _interval(one: Mapping[Hashable, Any], is_present: bool) -> Cell:
    text = "–" if is_present else interval_text(one["lower"], one["upper"])
    return Cell("–", "number quiet") if text in ("–", NOT_KNOWN) else Cell(text, "number")


def _status(one: Mapping[Hashable, Any]) -> Cell:
    return Cell(one["status"], "short bad" if one["status"] in OUT else "short")


def _probability(value: float | None, is_present: bool) -> Cell:
    known = is_present or (value is not None and math.isfinite(value))
    if is_present or not known:
        return Cell("–", "number quiet")
    return number(value, 2)


def _better_on(one: Mapping[Hashable, Any], is_present: bool) -> Cell:
    return Cell("–", "number quiet") if is_present else Cell(f"{one['flights_better']} of {one['flights']}", "number")


def _share(value: float | None) -> Cell:
    if value is None or not math.isfinite(value):
        return Cell("–", "number quiet")
    return Cell(f"{100.0 * value:.0f} %", "number")


def sign_table(results: Results) -> str:
    """On which flights each set beats the present one: a column per flight, the oldest first."""
    changes = flight_changes(results)
    if changes.empty or not len(changes.columns):
        return ""
    flights = [name for name in results.flights if name in changes.index]
    rows: list[tuple[CellLike, ...]] = []
    for name in changes.columns:
        told = changes.loc[flights, name]
        rows.append((set_name(str(name), results), *(_mark(value) for value in told)))
    head = ("set", *flights)
    note = "Change of the prediction error on each flight, percent, the oldest first; below 0 is better. –: not scored."
    return table(head, rows, footer=note, kind="by-flight")


def _mark(change: float) -> Cell:
    if change != change:
        return Cell("–", "number quiet")
    return signed(change, kind="number good" if change < 0.0 else "number bad" if change > 0.0 else "number quiet")


def objections_table(results: Results) -> str:
    """Why sets are not eligible: vetoes, and kinds of prediction in which they are worse beyond doubt."""
    rows = []
    judged = {one["name"]: one for one in results.decision["ranking"]}
    for one in results.ranking.to_dict("records"):
        reasons = []
        if one["name"] != results.present:
            reasons = _first_few(judged[one["name"]]["reasons"]) + [
                f"{AIM_WORDS[aim]} its errors are {_percent(one[f'{aim}_difference']):.1f} % larger than now (interval "
                f"{interval_text(one[f'{aim}_lower'], one[f'{aim}_upper'])} %)"
                for aim in judged[one["name"]]["worse_aims"]
            ]
        if reasons:
            rows.append((Cell(one["name"], "short"), "; ".join(reasons)))
    return details(f"{count_words(len(rows), 'set')} not eligible, and why", table(("set", "because"), rows))


def _first_few(reasons: Sequence[str]) -> list[str]:
    more = len(reasons) - _MOST_REASONS
    return [*reasons[:_MOST_REASONS], f"and {more} more of this kind"] if more > 1 else list(reasons)


def criteria_table(results: Results) -> str:
    """All criteria that stand beside the score."""
    source = results.decision["rule"]["main_source"]
    columns = {
        "score": "score",
        f"rms_{source}_horizontal": "RMS horizontal",
        f"rms_{source}_vertical": "RMS vertical",
        f"nll_{source}": "NLL",
        "nll_all_sources": "NLL, all sources",
        f"mean_nis_{source}": "mean NIS",
        f"j_nis_{source}": "J_NIS",
        f"c_nis_{source}": "C_NIS",
        f"lag1_{source}": "lag-1",
        "break_rate_gate": "break rate",
        "resets": "resets",
        "timeouts": "lost sources",
        "faults": "flights with faults",
    }
    rows: list[tuple[CellLike, ...]] = [
        (set_name(one["name"], results), *(number(one[column]) for column in columns))
        for one in results.ranking.to_dict("records")
    ]
    source_label, unit = AID_SOURCES[source].label, AID_SOURCES[source].unit
    note = (
        f"Of the {source_label} ({unit}), mean over flights, unless said otherwise; shown, not ranked by, "
        "but for the score, by which the sets are ranked: scale-profiled NLL, lower is better. The mean NIS "
        f"should be {AID_SOURCES[source].axes}: far below means that the noise is set larger than it is."
    )
    return table(("set", *columns.values()), rows, footer=note)


def _percent(difference: float) -> float:
    return float(percent_change(difference))
