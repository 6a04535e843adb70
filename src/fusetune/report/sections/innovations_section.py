"""The innovations of each source, by set, and beside them the vehicle's own."""

from fusetune.px4.aid_sources import AID_SOURCES, REPORTED_SOURCES
from fusetune.report.charts.innovations import (
    breaks_chart,
    consistency_chart,
    innovations_chart,
    normalised_innovations_chart,
    rms_chart,
)
from fusetune.report.innovation_tables import rms_table
from fusetune.report.markup import Cell, details, number, paragraph, section, table
from fusetune.report.results import Results, figure_values, pooled_samples
from fusetune.report.results import as_flown as own_innovations

_AS_FLOWN_GROUPS = tuple((source.name, source.groups[-1][0]) for source in REPORTED_SOURCES)


def innovations_section(results: Results) -> str:
    """RMS per variable and set as in the paper's table 12; empty without flights."""
    if not results.flights:
        return ""
    rms = rms_table(results)
    rows: list[list[Cell | str]] = []
    for variable, values in rms.iterrows():
        if values.notna().any():
            best = values.idxmin()
            rows.append(
                [
                    str(variable),
                    *(number(values[name], 4, "number best" if name == best else "number") for name in rms.columns),
                ]
            )
    parts = []
    if rows:
        units = (
            "In m, m/s and G; mean over the flights; the smallest of each row is marked. Small is not yet good: the "
            "ranking tells."
        )
        parts.append(details("RMS of each", table(("variable", *map(str, rms.columns)), rows, footer=units)))
    pooled = pooled_samples(results)
    parts = [rms_chart(results), *parts]
    parts += [
        details("What each source surprised the filter by", innovations_chart(results, pooled)),
        details("In units of the uncertainty that the filter claimed", normalised_innovations_chart(results, pooled)),
        details("Consistency", consistency_chart(results)),
        details("Fusion breaks", breaks_chart(results)),
    ]
    parts.append(as_flown(results))
    return section("The innovations", *parts, id="innovations")


def as_flown(results: Results) -> str:
    """The vehicle's own innovations beside the replay of the present set."""
    own = own_innovations(results)
    rows = []
    for source, axis in _AS_FLOWN_GROUPS:
        row: list[Cell | str] = [AID_SOURCES[source].label]
        found = False
        for metric in ("rms_innovation", "mean_nis"):
            logged = own[(own["source"] == source) & (own["axis"] == axis) & (own["metric"] == metric)]
            flights = set(logged["flight"])
            replayed = figure_values(results, source, axis, metric)
            replayed = replayed[(replayed["set"] == results.present) & replayed["flight"].isin(flights)]
            found |= len(logged) > 0
            row += [number(float(logged["value"].mean())), number(float(replayed["value"].mean()))]
        if found:
            rows.append(row)
    if not rows:
        return ""
    text = (
        "What the vehicle's own estimator logged, on the same part of the same flights. It differs from the replay "
        "where the firmware is another release, the log is thinned, or the vehicle flew other parameters."
    )
    head = ("source", "RMS as flown", "RMS replayed", "mean NIS as flown", "mean NIS replayed")
    return details("The vehicle's own innovations beside the replay", paragraph(text), table(head, rows))
