"""The parts of the page about the decision: what to fly, why, and what the other rules would say."""

from html import escape
from pathlib import Path
from typing import Any

from fusetune.analyze.sources import AID_SOURCES
from fusetune.px4.ekf2_parameters import PARAMETERS
from fusetune.report.markup import Cell, figure, number, paragraph, section, signed, table
from fusetune.report.results import Results
from fusetune.report.summary_figures import percent_change

_HEADINGS = {"change": "Change to “{chosen}”", "keep": "Keep what flies now", "no_evidence": "Keep what flies now"}
_OUT = ("vetoed", "not_scored")
_STATUS_WORDS = {"present": "flies now", "candidate": "eligible", "vetoed": "not eligible", "not_scored": "not scored"}


def decision_section(results: Results) -> str:
    """The decision in a box, with what changes and how to load it."""
    decision = results.decision
    status = decision["status"]
    heading = escape(_HEADINGS[status].format(chosen=decision["chosen"]))
    tag = '<span class="tag">exploratory</span>' if decision["exploratory"] else ""
    parts = [f'<section class="decision {escape(status)}"><h2>{heading}{tag}</h2>', paragraph(decision["paragraph"])]
    if decision["changes"]:
        rows = [_change_row(change) for change in decision["changes"]]
        parts.append(table(("parameter", "now", "new", "unit", ""), rows))
        parts.append(
            paragraph(
                "Load results/apply/best_params.params in QGroundControl (Parameters → Tools → Load from file), "
                "reboot, and fly a short, safe flight first. results/apply/rollback.params brings the old values back.",
                "note",
            )
        )
    else:
        parts.append(paragraph("There is nothing to load: best_params.params holds no parameter and says so.", "note"))
    return "".join(parts) + "</section>"


def _change_row(change: dict[str, Any]) -> tuple[Cell, ...]:
    reboot = "after a reboot" if change["reboot_required"] else ""
    return (
        Cell(change["name"], "mono"),
        number(change["previous"], 6),
        number(change["value"], 6),
        Cell(change["unit"]),
        Cell(reboot, "quiet"),
    )


def evidence_section(results: Results, figures: Path) -> str:
    """Forest plot, heat map and ranking."""
    rule = results.decision["rule"]
    label = AID_SOURCES[rule["main_source"]].label
    return section(
        "What the flights say",
        paragraph(
            f"Every set was replayed on every flight, so the sets saw the same samples. A set is better when its "
            f"{label} prediction errors, measured before each sample was used and relative to the course of the "
            "uncertainty that the filter claims, are smaller. How large it sets that uncertainty does not count."
        ),
        figure(
            figures / "differences.svg",
            f"Dot: mean over the flights; bar: {rule['confidence']:.0%} interval from redrawing flights and their "
            "blocks of about 10 s. A set replaces the present one only if its bar lies wholly left of the line.",
        ),
        figure(
            figures / "flights_by_sets.svg", "Does it hold on each flight? A set that is good should be so on most."
        ),
        _ranking_table(results),
        _vetoes(results),
        _criteria_table(results),
    )


def _ranking_table(results: Results) -> str:
    head = ("set", "", "score", "change %", "interval %", "p", "p (Holm)", "P(best)", "better on")
    rows = []
    for one in results.ranking.to_dict("records"):
        percent = [_percent(one[name]) for name in ("difference", "lower", "upper")]
        interval = "–" if one["name"] == results.present else f"{signed(percent[1]).text} … {signed(percent[2]).text}"
        equal = " (same results as now)" if one["equal_to_present"] else ""
        rows.append(
            (
                _name(one["name"], results),
                Cell(_STATUS_WORDS[one["status"]] + equal, "short bad" if one["status"] in _OUT else "short"),
                number(one["score"], 4),
                signed(percent[0]),
                Cell(interval, "number"),
                number(one["p_value"], 2),
                number(one["p_holm"], 2),
                Cell(f"{100.0 * one['p_best']:.0f} %", "number"),
                Cell(f"{one['flights_better']} of {one['flights']}", "number"),
            )
        )
    note = (
        "score: scale-profiled NLL, lower is better. change: of the prediction error. p: probability of such a "
        "difference by chance, alone and corrected for the number of candidates."
    )
    return table(head, rows, "Ranking, best first") + paragraph(note, "note")


def _criteria_table(results: Results) -> str:
    source = results.decision["rule"]["main_source"]
    columns = {
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
    rows = [
        (_name(one["name"], results), *(number(one[column]) for column in columns))
        for one in results.ranking.to_dict("records")
    ]
    source_label, unit = AID_SOURCES[source].label, AID_SOURCES[source].unit
    note = (
        f"Of the {source_label} ({unit}), mean over flights, unless said otherwise; shown, not ranked by. The mean NIS "
        f"should be {AID_SOURCES[source].axes}: far below means that the noise is set larger than it is."
    )
    return table(("set", *columns.values()), rows, "All criteria") + paragraph(note, "note")


def _name(name: str, results: Results) -> Cell:
    return Cell(name, "short best" if name == results.decision["chosen"] else "short")


def _percent(difference: float) -> float:
    return float(percent_change(difference))


def _vetoes(results: Results) -> str:
    rows = [
        (Cell(one["name"], "short"), one["reasons"])
        for one in results.ranking.to_dict("records")
        if one["status"] in _OUT
    ]
    return table(("not eligible", "because"), rows) if rows else ""


def sets_section(results: Results) -> str:
    """What each set changes, and where that could act."""
    sets = {one["set"]: one for one in results.decision["sets"]}
    parameters = sorted({name for one in sets.values() for name in one["overrides"]})
    now = _present_parameters(results)
    rows = []
    for parameter in parameters:
        row = [Cell(parameter, "mono"), Cell(_unit(parameter), "quiet")]
        for name in results.shown:
            value = sets[name]["overrides"].get(parameter)
            kind = "number quiet" if value is None else "number"
            row.append(number(now.get(parameter) if value is None else value, 6, kind))
        rows.append(row)
    parts = [table(("parameter", "unit", *results.shown), rows, "Values; grey: as the vehicle has it now")]
    described = [(_name(name, results), one["description"]) for name, one in sets.items() if one["description"]]
    if described:
        parts.append(table(("set", "description"), described))
    inactive = _inactive(results.decision["sets"])
    if inactive:
        parts += [paragraph("Parameters that could not act:"), table(("set", "parameter", "why", "flights"), inactive)]
    return section("The parameter sets", *parts)


def _present_parameters(results: Results) -> dict[str, float]:
    newest = results.decision["newest_flight"]
    return results.scoring[newest]["sets"][results.present]["parameters"] if newest else {}


def _unit(name: str) -> str:
    return PARAMETERS[name].unit if name in PARAMETERS else ""


def _inactive(sets: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    rows: dict[tuple[str, str], list[tuple[str, str]]] = {}

    def more(found: list[tuple[str, str]]) -> str:
        return " …" if len(found) > 3 else ""

    for one in sets:
        for flight, reasons in one["inactive"].items():
            for parameter, why in reasons.items():
                if not why.startswith("has the same value"):
                    rows.setdefault((one["set"], parameter), []).append((flight, why))
    return [
        (name, parameter, found[0][1], f"{len(found)}: " + ", ".join(flight for flight, _ in found[:3]) + more(found))
        for (name, parameter), found in sorted(rows.items())
    ]


def paper_section(results: Results) -> str:
    """What the paper's own rule would choose, and why it may differ."""
    mode = results.decision["paper_mode"]
    if mode["first"] is None:
        return ""
    verdict = "the same set" if mode["agrees"] else f"“{mode['first']}”"
    text = (
        f"The paper's rule ({mode['rule']}) would choose {verdict}. It takes the size of the innovations for their "
        "quality, so a set that follows wandering measurements wins, and it has no measure of chance."
    )
    rows = [
        (
            one["name"],
            number(one["aggregate_rms"], 4),
            {True: "yes", False: "no", None: "unknown"}[one["consistent"]],
            number(100.0 * one["break_rate"], 3),
        )
        for one in mode["ranking"]
    ]
    head = ("set", "aggregate RMS", "NIS inside the χ² bounds", "break rate %")
    return section("Paper mode", paragraph(text), table(head, rows))
