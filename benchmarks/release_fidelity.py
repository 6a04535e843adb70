"""Replay reference flights as the estimators of several releases and print how close each replay is, as Markdown.

    python -m benchmarks.release_fidelity LOGS_DIR REFERENCES_DIR                          # all that are modelled
    python -m benchmarks.release_fidelity LOGS_DIR REFERENCES_DIR --release main --flight synthetic__mc_flow
    python -m benchmarks.release_fidelity LOGS_DIR REFERENCES_DIR --totals docs/releases.md --flights docs/fidelity.md

REFERENCES_DIR holds a folder per release (v1.17, main, …), in it one per flight, with what the estimator of that
release computed, as docs/fidelity.md describes it. A line stands for a release, a flight and a set; the last of a
release for all of it. Lines beyond the limits of `LIMITS` end with what is beyond, and the status is 1. The two
documents take the last lines, and a line for each release and flight.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.decision_study.tables import between_marks
from benchmarks.reference_flights import log_of, reference_folders

from fusetune.analyze.replaying.replay_log import replay_log
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.trust.fidelity import ReplayFidelity, compare_folders, order_agreement
from fusetune.ekf2.releases.behaviours import MODELLED, RELEASES
from fusetune.errors import UserError

TOTALS, FLIGHTS = "releases as measured", "flights by release"
"""Places of the tables in the documents."""

TOTALS_HEADER = (
    "release", "order of sets (τ)", "runs", "RMS diff., median", "worst", "worst axis", "variance, median",
    "fused equal", "rejected equal", "flags equal", "resets", "missing", "beyond the limits",
)  # fmt: skip
FLIGHTS_HEADER = (
    "release", "flight", "sets", "RMS diff., median", "worst", "worst axis", "variance, median", "fused equal",
    "rejected equal", "flags equal", "resets", "missing",
)  # fmt: skip

HEADER = (
    "| release | flight | set | RMS diff., median | worst | worst axis | variance, median | fused equal | "
    "rejected equal | flags equal | resets | missing | beyond |"
)


class Limits(NamedTuple):
    """What a release must reach: shares, of each run the worst axis but for the medians."""

    median: float
    worst: float
    variance: float
    decisions: float
    flags: float


LIMITS = {
    **dict.fromkeys(("v1.15", "v1.16", "v1.17", "main"), Limits(0.001, 0.02, 0.0005, 0.999, 0.999)),
    **dict.fromkeys(("v1.13", "v1.14"), Limits(0.005, 0.05, 0.005, 0.995, 0.99)),
}


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.release_fidelity",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("logs", type=Path)
    parser.add_argument("references", type=Path)
    parser.add_argument("--release", action="append", choices=RELEASES, help="by default all that are modelled")
    parser.add_argument("--flight", action="append", help="by default all of a release")
    parser.add_argument("--totals", type=Path, metavar="DOCUMENT", help="takes the table of releases")
    parser.add_argument("--flights", type=Path, metavar="DOCUMENT", help="takes the table of releases and flights")
    options = parser.parse_args(arguments)
    if (options.totals or options.flights) and (options.release or options.flight):
        parser.error("documents take the tables of all releases and flights")
    releases = options.release or [one for one in MODELLED if (options.references / one).is_dir()]
    print(HEADER)
    print("|---" * HEADER.count(" | ") + "|---|")
    failed = False
    totals, flights = [list(map(table_line, (head, ["---"] * len(head)))) for head in (TOTALS_HEADER, FLIGHTS_HEADER)]
    for release in releases:
        everything: list[ReplayFidelity] = []
        orders: list[float] = []
        for flight, results in compared(release, options.references / release, options.logs, options.flight):
            if isinstance(results, UserError):
                print(f"| {release} | {flight} | – | {results} " + "| – " * 9 + "|", flush=True)
                failed = True
                continue
            everything += results
            orders.append(order_agreement(results))
            for one in results:
                print(line(release, flight, one), flush=True)
            flights.append(table_line([release, flight, *_figures(results), _missing(results)]))
        if everything:
            totals.append(total(release, everything, orders))
            print(totals[-1], flush=True)
            failed |= any(beyond(release, one) for one in everything)
    for document, place, lines in ((options.totals, TOTALS, totals), (options.flights, FLIGHTS, flights)):
        if document is not None:
            text = document.read_text(encoding="utf-8")
            document.write_text(between_marks(text, place, "\n".join(lines)), encoding="utf-8")
    return int(failed)


def compared(
    release: str, references: Path, logs: Path, flights: Sequence[str] | None
) -> Iterator[tuple[str, list[ReplayFidelity] | UserError]]:
    """Replay and compare the flights of a release one after the other."""
    for reference in reference_folders(references):
        if flights and reference.name not in flights:
            continue
        with tempfile.TemporaryDirectory() as scratch:
            try:
                replays = Path(scratch) / "replays"
                settings = ReplaySettings(release=release)
                replay_log(log_of(reference.name, logs, Path(scratch)), reference, replays, settings)
                yield reference.name, compare_folders(reference, replays)
            except UserError as error:
                yield reference.name, error


def beyond(release: str, result: ReplayFidelity) -> list[str]:
    """Names of the figures of a run that do not reach what its release must."""
    limits, axes = LIMITS[release], result.axes
    if not axes:
        return ["no sample"]
    reached = {
        "median": result.median_relative_rms <= limits.median,
        "worst": max(axis.relative_rms for axis in axes) <= limits.worst,
        "variance": statistics.median(axis.variance_difference for axis in axes) <= limits.variance,
        "fused": min(axis.fused_equal for axis in axes) >= limits.decisions,
        "rejected": min(axis.rejected_equal for axis in axes) >= limits.decisions,
        "flags": not result.flags_equal < limits.flags,
        "resets": result.resets_equal,
    }
    return [name for name, is_reached in reached.items() if not is_reached]


def line(release: str, flight: str, result: ReplayFidelity) -> str:
    """One run of the table."""
    worst = result.worst
    if worst is None:
        return f"| {release} | {flight} | {result.set} | no sample of a compared source " + "| – " * 9 + "|"
    cells = [
        release,
        flight,
        result.set,
        f"{result.median_relative_rms:.4%}",
        f"{worst.relative_rms:.3%}",
        f"{worst.source}[{worst.axis}]",
        f"{statistics.median(axis.variance_difference for axis in result.axes):.5%}",
        f"{min(axis.fused_equal for axis in result.axes):.3%}",
        f"{min(axis.rejected_equal for axis in result.axes):.3%}",
        f"{result.flags_equal:.3%}",
        "equal" if result.resets_equal else "differ",
        f"{result.missing:.3%}",
        ", ".join(beyond(release, result)),
    ]
    return table_line(cells)


def total(release: str, results: list[ReplayFidelity], orders: list[float]) -> str:
    """All runs of a release: median and worst, and the least order of sets (Kendall τ) of its flights."""
    known = [order for order in orders if order == order]
    order = f"τ ≥ {min(known):.2f}" if known else "–"
    outside = sum(bool(beyond(release, one)) for one in results)
    return table_line([f"**{release}**", order, *_figures(results), _missing(results), f"{outside} runs"])


def _figures(results: list[ReplayFidelity]) -> list[str]:
    """How many runs, and their figures: medians over all axes, and the worst."""
    axes = [axis for one in results for axis in one.axes]
    if not axes:
        return [str(len(results)), "no sample of a compared source", *["–"] * 7]
    worst = max(axes, key=lambda axis: axis.relative_rms)
    return [
        str(len(results)),
        f"{statistics.median(axis.relative_rms for axis in axes):.4%}",
        f"{worst.relative_rms:.3%}",
        f"{worst.source}[{worst.axis}]",
        f"{statistics.median(axis.variance_difference for axis in axes):.5%}",
        f"{min(axis.fused_equal for axis in axes):.3%}",
        f"{min(axis.rejected_equal for axis in axes):.3%}",
        f"{min(one.flags_equal for one in results):.3%}",
        f"{sum(one.resets_equal for one in results)} of {len(results)} equal",
    ]


def _missing(results: list[ReplayFidelity]) -> str:
    return f"{max(one.missing for one in results):.3%}"


def table_line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    sys.exit(main())
