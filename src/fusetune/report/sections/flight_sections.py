"""The parts of the page about the flights: verdicts, figures of the innovations, single flights, origin."""

from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fusetune.finding import from_documents
from fusetune.px4.aid_sources import AID_SOURCES, REPORTED_SOURCES
from fusetune.report.figures.innovation_figures import rms_table
from fusetune.report.markup import Cell, details, figure, number, paragraph, section, table
from fusetune.report.results import Results, as_flown, figure_values
from fusetune.report.sections.advice import advice_table
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table

_AS_FLOWN_GROUPS = tuple((source.name, source.groups[-1][0]) for source in REPORTED_SOURCES)


def flights_section(results: Results, flights_table: AnyPath) -> str:
    """Every log with its verdict."""
    verdicts = read_table(flights_table).to_pandas().to_dict("records")
    rows = [_flight_row(verdict, results) for verdict in sorted(verdicts, key=lambda one: str(one["flight"]))]
    head = ("flight", "verdict", "scored s", "airborne s", "vehicle", "firmware", "reason")
    count, decide = len(rows), results.decision["flights_scored"]
    text = f"{count} log{'s' if count != 1 else ''}, {len(results.scored)} scored, {decide} in the decision."
    return section("The flights", paragraph(text), table(head, rows), advice_table(verdicts))


def _flight_row(verdict: Mapping[Hashable, Any], results: Results) -> tuple[Cell | str, ...]:
    name = verdict["flight"]
    decides, scored = name in results.flights, name in results.scored
    analysed = name in results.scoring
    reason = results.reason(name) if analysed and not decides else verdict.get("reason") or ""
    words = _part(name, results) if analysed else str(verdict["status"])
    return (
        Cell(str(name)),
        Cell(words, "short good" if decides else "short bad"),
        number(results.scoring[name]["scored_s"] if scored else None),
        number(verdict.get("airborne_s")),
        str(verdict.get("vehicle") or "unknown"),
        Cell(str(verdict.get("firmware") or "unknown"), "short"),
        str(reason),
    )


def _part(name: str, results: Results) -> str:
    """What became of an analysed flight."""
    if name in results.flights:
        return "scored"
    return "not counted" if name in results.scored else "not scored"


def innovations_section(results: Results, figures: AnyPath) -> str:
    """RMS per variable and set as in the paper's table 12, box plots, consistency, breaks; empty without flights."""
    figures = Path(figures)
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
            "m, m/s and G; mean over the flights; the smallest of each row is marked. Small is not yet good: see above"
        )
        parts.append(table(("variable", *map(str, rms.columns)), rows, f"RMS of the innovations ({units})"))
    captions = {
        "rms.svg": "The same against the present set.",
        "innovations.svg": "What each source surprised the filter by. North, east and down are x, y and z.",
        "normalised_innovations.svg": "In units of the uncertainty that the filter claimed: narrower boxes mean that "
        "it claims more noise than there is. Dashed: where the whiskers of a consistent filter end.",
        "consistency.svg": "Dotted: the paper's χ² bounds, which take samples as independent; band: those with the "
        "effective number of samples (the median flight's). A filled dot lies inside its own flight's bounds of the "
        "second kind. Left of the bounds the filter claims more noise than there is, right of them less.",
        "breaks.svg": "Share of samples beyond 3 σ, 5 σ and the gate, on the scored part of the flights that decide.",
    }
    parts += [figure(figures / name, caption) for name, caption in captions.items()]
    return section("The innovations", *parts)


def as_flown_section(results: Results) -> str:
    """The vehicle's own innovations beside the replay of the present set."""
    own = as_flown(results)
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
    return section("As flown", paragraph(text), table(head, rows))


def single_flights_section(results: Results, flight_figures: Mapping[str, AnyPath]) -> str:
    """One picture and the cuts per flight, closed until asked for."""
    parts = []
    for name, summary in results.scoring.items():
        decides = name in results.flights
        words = f"{summary['scored_s']:.0f} s scored" if decides else f"{_part(name, results)}: {results.reason(name)}"
        inside = [_cuts(summary), _set_troubles(summary)]
        if name in flight_figures:
            caption = (
                "Grey: not scored (ground, warm-up, cuts). The dashed line is the gate. Of other sets than the present "
                "one what is scored is drawn."
            )
            inside.insert(0, figure(flight_figures[name], caption))
        parts.append(details(f"{name} – {words}", *inside, kind="good" if decides else "bad"))
    return section("Flight by flight", *parts) if parts else ""


def _cuts(summary: dict[str, Any]) -> str:
    rows = [(f"{cut.figure:.1f} {cut.unit}", cut.found) for cut in from_documents(summary["cuts"])]
    return table(("cut", "because of"), rows) if rows else ""


def _set_troubles(summary: dict[str, Any]) -> str:
    rows = []
    for name, one in summary["sets"].items():
        resets = sum(one["resets"].values())
        lost = ", ".join(f"{source} ×{count}" for source, count in one["timeouts"].items())
        faults = ", ".join(fault.removeprefix("fs_") for fault in one["faults"])
        if one["reason"] or one["evidence"]["left_out"] or resets or lost or faults:
            far = f"{resets}, {one['significant_resets']} of them far" if resets else "0"
            rows.append((name, far, lost, faults, one["reason"] or "; ".join(one["evidence"]["left_out"].values())))
    return table(("set", "resets in flight", "lost sources", "faults", "note"), rows) if rows else ""


def provenance_section(results: Results) -> str:
    """Checksums, hashes and rules: enough to repeat the decision."""
    decision = results.decision
    logs = [
        (Cell(str(row["flight"])), Cell(str(row["checksum"] or ""), "mono"), str(row["firmware"] or "unknown"))
        for row in decision["flights"]
    ]
    files = [(name, Cell(digest, "mono")) for name, digest in decision["provenance"]["configuration_files"].items()]
    rule = [(str(key), str(value)) for key, value in decision["rule"].items()]
    return section(
        "Where this comes from",
        paragraph(f"Made by {decision['provenance']['product']}."),
        details(
            "Checksums and settings",
            table(("log", "SHA-256", "firmware"), logs),
            table(("configuration file", "SHA-256"), files) if files else "",
            table(("setting of the decision", "value"), rule),
        ),
    )


def flight_figure_paths(names: Sequence[str], paths: Sequence[AnyPath]) -> dict[str, Path]:
    """Pictures by flight, from two sequences of one order."""
    return {name: Path(path) for name, path in zip(names, paths, strict=True)}
