"""The parts of the page about the evidence: comparison, drift, whether the choice holds, weights, the paper's rule."""

import numpy as np
import pandas as pd

from fusetune.apply.evidence import AIDED, SMOOTHED, UNAIDED
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.report.charts.differences import differences_chart
from fusetune.report.charts.drift import drift_chart
from fusetune.report.charts.flights_by_sets import flights_by_sets_chart
from fusetune.report.charts.pareto import pareto_chart
from fusetune.report.comparison import percent_change
from fusetune.report.markup import Cell, CellLike, bullets, details, number, paragraph, section, signed, table
from fusetune.report.results import Results
from fusetune.report.sections.ranking_tables import (
    NOT_KNOWN,
    criteria_table,
    interval_text,
    objections_table,
    ranking_table,
    set_name,
    sign_table,
)
from fusetune.report.withheld import (
    BAROMETER,
    MAGNETOMETER,
    POSITION,
    VELOCITY,
    Withheld,
    drift,
    drift_summary,
    gap_lengths,
    usual_gap_length,
)


def evidence_section(results: Results) -> str:
    """Every set against the present one: ranking, intervals, objections; empty where no flight has a say."""
    if not results.flights:
        return ""
    return section(
        "What the flights say of the sets",
        paragraph(
            "Every set was replayed on every flight, so the sets saw the same samples. They are judged by how far off "
            "they predicted: aided, one step ahead; unaided, after seconds without GNSS; smoothed, against the "
            "velocity that the whole flight makes likely. How large a set says its uncertainty is does not count."
        ),
        differences_chart(results),
        details("The ranking in figures", ranking_table(results)),
        objections_table(results),
        details("All other criteria", criteria_table(results)),
        id="ranking",
    )


def flight_by_flight_section(results: Results) -> str:
    """Does it hold on each flight? Empty where no flight has a say."""
    if not results.flights:
        return ""
    figures = details("The figures", sign_table(results))
    return section("On each flight", flights_by_sets_chart(results), figures, id="each-flight")


def withheld_section(results: Results) -> str:
    """Drift while sensors are withheld, and the two aims against each other; empty where no flight has a say."""
    if not results.flights:
        return ""
    told = [_drift_table(results, (POSITION, VELOCITY), "Without GNSS, horizontal")]
    told.append(_drift_table(results, (BAROMETER, MAGNETOMETER), "Without barometer, without magnetometer"))
    if not any(told):
        return ""
    parts = [
        paragraph(
            "Several times in each flight GNSS, and at other times the barometer or the magnetometer, was kept from "
            "the estimator for some seconds while it flew on. What the sensor measured in the end shows how far the "
            "prediction had drifted: the better the estimator knew its velocity, attitude and biases, the less."
        ),
        details("How far it drifted", drift_chart(results)),
        details("Two aims against each other", pareto_chart(results)),
        details("Figures of the drift", *told, _drift_note(results) if told[1] else "", *_shorter_gaps(results)),
    ]
    return section("Without a sensor", *parts, id="withheld")


def _drift_table(results: Results, withheld: tuple[Withheld, ...], caption: str) -> str:
    summaries = [(one, summary) for one in withheld if len(summary := drift_summary(results, one))]
    if not summaries:
        return ""
    head = ["set"]
    for one, summary in summaries:
        head += [f"{_sensed(one)} after {seconds:g} s [{one.unit}]" for seconds in _horizons(summary)]
        head += ["change %"]
    rows = []
    for name in results.shown:
        row: list[CellLike] = [set_name(name, results)]
        for _, summary in summaries:
            last = _horizons(summary)[-1]
            row += [number(_figure(summary, name, seconds, "mean")) for seconds in _horizons(summary)]
            row.append(signed(None if name == results.present else _figure(summary, name, last, "change")))
        rows.append(row)
    return table(head, rows, f"{caption}: drift, mean over the flights; change: at the end, against the present set")


def _shorter_gaps(results: Results) -> list[str]:
    """Which flights count with gaps of another length than those that are drawn."""
    table = drift(results, POSITION)
    if table.empty:
        return []
    lengths = gap_lengths(table)
    usual = usual_gap_length(lengths)
    others = lengths[lengths != usual]
    if others.empty:
        return []
    told = ", ".join(f"{flight} {seconds:g} s" for flight, seconds in others.items())
    text = f"Drawn are gaps of {usual:g} s. Flights with gaps of another length count in the ranking, too: {told}."
    return [paragraph(text, "note")]


def _drift_note(results: Results) -> str:
    flights = [
        f"{one.label}: {int(summary['flights'].max())} flights"
        for one in (BAROMETER, MAGNETOMETER)
        if len(summary := drift_summary(results, one))
    ]
    return paragraph(f"Shown, not ranked by ({'; '.join(flights)}).", "note")


def _sensed(withheld: Withheld) -> str:
    return AID_SOURCES[withheld.source].quantity


def _horizons(summary: pd.DataFrame) -> list[float]:
    return sorted(set(summary.index.get_level_values("horizon_s")))


def _figure(summary: pd.DataFrame, name: str, horizon_s: float, column: str) -> float | None:
    return float(summary[column].loc[name, horizon_s]) if (name, horizon_s) in summary.index else None


def holds_section(results: Results) -> str:
    """Each flight left out in turn: what would have been chosen, and what that was worth there."""
    validated = results.decision["leave_one_out"]
    title = "Does the choice hold?"
    if validated is None:
        return ""
    chosen, worth = validated["chosen"], validated["differences"]
    ordered = sorted(chosen, key=lambda flight: results.flights.index(flight) if flight in results.flights else -1)
    rows: list[tuple[CellLike, ...]] = [
        (flight, set_name(chosen[flight], results), _worth(worth[flight])) for flight in ordered
    ]
    rows.append((Cell("mean", "quiet"), Cell(""), signed(float(percent_change(validated["difference"])))))
    return section(
        title,
        paragraph(_holds(results)),
        details(
            "Each flight", table(("flight left out", "best set of the others", "change of the error there %"), rows)
        ),
        paragraph(
            "Each flight was left out in turn, the best eligible set chosen from the others and judged on the flight "
            "that had no part in choosing it. Below 0 is better than the present set. This shows how much hangs on "
            "single flights; whether a set is proved better is told by its interval and by p.",
            "note",
        ),
    )


def _worth(difference: float) -> Cell:
    kind = "number good" if difference < 0.0 else "number bad" if difference > 0.0 else "number"
    return signed(float(percent_change(difference)), kind=kind)


def _holds(results: Results) -> str:
    validated = results.decision["leave_one_out"]
    count, stays = len(validated["chosen"]), validated["stays"]
    names = set(validated["chosen"].values())
    if names == {results.present}:
        return "Whichever flight is left out, no set does better than the present one on the others."
    change = float(percent_change(validated["difference"]))
    confidence = results.decision["rule"]["confidence"]
    ends = interval_text(validated["lower"], validated["upper"])
    span = f"{confidence:.0%} interval {ends}{'' if ends == NOT_KNOWN else ' %'}"
    size = f"{abs(change):.1f} % {'larger' if change >= 0.0 else 'smaller'} than now"
    if stays == count:
        same = "the same set is best whichever flight is left out"
    else:
        same = f"the best set is the same without any one of {stays} of the {count} flights, another without the rest"
    return f"On a flight that had no part in the choice the errors are {size} on average ({span}); {same}."


def weights_section(results: Results) -> str:
    """How much each kind of prediction counts on each flight, and the whiteness behind it."""
    weights, rule = results.decision["weights"], results.decision["rule"]
    if not weights:
        return ""
    shares = _white_shares(results)
    sources = [name for name, weight in rule["sources"].items() if weight > 0.0 and name in shares.columns]
    rows = [
        (
            flight,
            *(_share(shares, flight, source) for source in sources),
            Cell(f"{100.0 * of_aim.get(AIDED, 0.0):.0f} %", "number"),
            Cell(f"{100.0 * of_aim.get(UNAIDED, 0.0):.0f} %", "number"),
            Cell(f"{100.0 * of_aim.get(SMOOTHED, 0.0):.0f} %", "number"),
        )
        for flight, of_aim in sorted(weights.items())
    ]
    head = (
        "flight",
        *(f"{AID_SOURCES[one].label}, white" for one in sources),
        "weight aided",
        "weight unaided",
        "weight smoothed",
    )
    text = (
        "A filter that follows a wandering measurement predicts it well without knowing better, so the predictions one "
        "step ahead count only as far as the error of the measurement is white: fully from "
        f"{100.0 * rule['trust_white_share']:.0f} % on, not at all below {100.0 * rule['distrust_white_share']:.0f} %. "
        "As far as they do not, the difference of the velocity to one that is smoothed from the whole flight counts, "
        "which takes the wander for the receiver's. "
        "Where a flight has only one of these to tell of, that one decides there."
    )
    unknown = not sources or any(cell.text == NOT_KNOWN for row in rows for cell in row if isinstance(cell, Cell))
    note = paragraph("A flight too short to show the whiteness of a source takes the mean of the others.", "note")
    return section(
        "What counts how much", paragraph(text), details("On each flight", table(head, rows), note if unknown else "")
    )


def _white_shares(results: Results) -> pd.DataFrame:
    """White share of the error by flight and source as the present set sees it: the mean over the axes."""
    metrics = results.metrics
    rows = metrics[
        (metrics["metric"] == "white_share")
        & (metrics["set"] == results.present)
        & metrics["axis"].isin(("x", "y", "z"))
    ]
    rows = rows[np.isfinite(rows["value"].astype(float))]
    found = rows.assign(flight=rows["flight"].astype(str), source=rows["source"].astype(str))
    return found.groupby(["flight", "source"])["value"].mean().unstack()


def _share(shares: pd.DataFrame, flight: str, source: str) -> Cell:
    value = shares[source].get(flight, np.nan)
    return Cell(f"{100.0 * value:.0f} %", "number") if np.isfinite(value) else Cell(NOT_KNOWN, "number quiet")


def paper_section(results: Results) -> str:
    """What the paper's own rule would choose, and where and why it differs from the decision."""
    mode = results.decision["paper_mode"]
    if mode["first"] is None:
        return ""
    text = f"For comparison, the rule of the paper that this method comes from ({mode['rule']}). " + (
        "It agrees with the decision." if mode["agrees"] else "It does not agree with the decision."
    )
    rows = [
        (
            set_name(one["name"], results),
            number(one["aggregate_rms"], 4),
            {True: "yes", False: "no", None: "unknown"}[one["consistent"]],
            number(100.0 * one["break_rate"], 3),
        )
        for one in mode["ranking"]
    ]
    head = ("set", "aggregate RMS", "NIS inside the χ² bounds", "break rate %")
    return section(
        "The paper's own rule",
        paragraph(text),
        details("Why, and its ranking", bullets(mode["why"]), table(head, rows)),
    )
