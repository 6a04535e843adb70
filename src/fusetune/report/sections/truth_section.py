"""What the truth says, where logs have one: whether it confirms the decision, and the true errors of every set."""

from __future__ import annotations

import pandas as pd

from fusetune.report.markup import Cell, details, number, paragraph, section, table
from fusetune.report.results import Results, figure_values

_TRUE_ERRORS = (
    ("truth_velocity", "all", "rmse", "velocity m/s"),
    ("truth_position", "all", "rmse", "position m"),
    ("truth_position_mean_removed", "all", "rmse", "position, mean removed m"),
    ("truth_attitude_deg", "tilt", "rmse", "tilt °"),
    ("truth_attitude_deg", "heading", "rmse", "heading °"),
    ("truth_withheld_position", "horizontal", "rmse", "drift of position in its gaps without GNSS m"),
    ("truth_withheld_velocity", "horizontal", "rmse", "drift of velocity in its gaps without GNSS m/s"),
    ("truth_velocity", "all", "nees", "velocity NEES / 3"),
)

_CONFIRMING = (
    ("truth_velocity", "all", "velocity", "m/s"),
    ("truth_attitude_deg", "all", "attitude", "°"),
    ("truth_position_mean_removed", "all", "position less its mean", "m"),
    ("truth_withheld_position", "horizontal", "drift of position without GNSS", "m"),
)
"""The four by which a choice is judged: source, axis, words, unit (docs/decision.md, The study)."""


def truth_verdict(results: Results) -> str:
    """Whether the truth confirms a change; empty where nothing changes or no truth is known."""
    return _compared(results)[0]


def truth_sentence(results: Results) -> str:
    """Whether the truth confirms a change, with figures; empty where nothing changes or no truth is known."""
    verdict, known = _compared(results)
    if not known:
        return ""
    flights = len(_true_errors(results, "flight"))
    whose = f"of {flights} of the flights" if flights < len(results.flights) else "of these flights"
    said = f"The truth {whose} is known; the decision never looks at it."
    return f"{said} It {verdict}: true error of {', '.join(known)}."


def _compared(results: Results) -> tuple[str, list[str]]:
    """What the truth says of a change, and each figure: the RMSE of the chosen set beside that of the present one, both
    means over the flights with a truth."""
    decision = results.decision
    if decision["status"] != "change":
        return "", []
    smaller: list[str] = []
    larger: list[str] = []
    known: list[str] = []
    metrics = results.metrics
    for source, axis, words, unit in _CONFIRMING:
        # Of all sets: a large study shows only some.
        wanted = (metrics["source"] == source) & (metrics["axis"] == axis) & (metrics["metric"] == "rmse")
        means = metrics[wanted].groupby("set", observed=True)["value"].mean()
        if not {decision["chosen"], results.present} <= set(means.index):
            continue
        now, new = float(means[results.present]), float(means[decision["chosen"]])
        if now == 0.0:
            continue
        if new != now:
            (smaller if new < now else larger).append(words)
        change = f"{100.0 * (new / now - 1.0):+.0f}".replace("-", "−")
        known.append(f"{words} {change} % ({_plain(now)} to {_plain(new)} {unit})".replace(" °)", "°)"))
    if not known:
        return "", []
    if not smaller and not larger:
        return "shows no difference", known
    if not larger:
        return "confirms the change", known
    if smaller:
        return f"confirms the change in {_listed(smaller)}, not in {_listed(larger)}", known
    return "speaks against the change", known


def truth_section(results: Results) -> str:
    """Errors against the ground truth, where logs have one: by set, and of the present set by flight."""
    by_set, by_flight = _true_errors(results, "set"), _true_errors(results, "flight")
    if by_set.empty:
        return ""
    flights = len(by_flight)
    text = (
        f"{flights} flight{'s have' if flights != 1 else ' has'} a known truth. The decision never looks at it; "
        "it shows here whether the decision deserves trust."
    )
    order = [name for name in results.shown if name in by_set.index]
    sentence = truth_sentence(results)
    return section(
        "Against the truth",
        paragraph(sentence or text),
        details("True errors of each set", _error_table("set", by_set.loc[order], "RMSE, mean over the flights")),
        details(
            "True errors on each flight",
            _error_table("flight", by_flight, f"RMSE of the set “{results.present}”"),
        ),
        id="truth",
    )


def _true_errors(results: Results, by: str) -> pd.DataFrame:
    """True errors, a row per set (mean over flights) or per flight (of the present set)."""
    columns = {}
    for source, axis, metric, label in _TRUE_ERRORS:
        rows = figure_values(results, source, axis, metric)
        if by == "flight":
            rows = rows[rows["set"] == results.present]
        if len(rows):
            values = rows.groupby(by, observed=True)["value"].mean()
            columns[label] = values / 3.0 if metric == "nees" else values
    return pd.DataFrame(columns)


def _error_table(first: str, frame: pd.DataFrame, caption: str) -> str:
    rows: list[list[Cell | str]] = [
        [str(name), *(number(float(value)) for value in values)]
        for name, values in zip(frame.index, frame.to_numpy(), strict=True)
    ]
    return table((first, *map(str, frame.columns)), rows, caption)


def _plain(value: float) -> str:
    return number(value, 2).text


def _listed(words: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))
