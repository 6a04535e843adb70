"""Replay reference flights as the estimators of several releases and print how close each replay is, as Markdown.

    python -m benchmarks.release_fidelity LOGS_DIR REFERENCES_DIR                          # all that are modelled
    python -m benchmarks.release_fidelity LOGS_DIR REFERENCES_DIR --release main --flight synthetic__mc_flow

REFERENCES_DIR holds a folder per release (v1.17, main, …), in it one per flight, with what the estimator of that
release computed, as docs/fidelity.md describes it. A line stands for a release, a flight and a set; the last of a
release for all of it. Lines beyond the limits of `LIMITS` end with what is beyond, and the status is 1.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.reference_flights import log_of, reference_folders

from fusetune.analyze.replaying.replay_log import replay_log
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.trust.fidelity import ReplayFidelity, compare_folders, order_agreement
from fusetune.ekf2.releases.behaviours import MODELLED, RELEASES
from fusetune.errors import UserError

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
    options = parser.parse_args(arguments)
    releases = options.release or [one for one in MODELLED if (options.references / one).is_dir()]
    print(HEADER)
    print("|---" * HEADER.count(" | ") + "|---|")
    failed = False
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
        if everything:
            print(total(release, everything, orders), flush=True)
            failed |= any(beyond(release, one) for one in everything)
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
    return "| " + " | ".join(cells) + " |"


def total(release: str, results: list[ReplayFidelity], orders: list[float]) -> str:
    """All runs of a release: median and worst, and the least order of sets (Kendall τ) of its flights."""
    axes = [axis for one in results for axis in one.axes]
    worst = max(axes, key=lambda axis: axis.relative_rms)
    known = [order for order in orders if order == order]
    cells = [
        f"**{release}**",
        f"τ ≥ {min(known):.2f}" if known else "–",
        str(len(results)),
        f"{statistics.median(axis.relative_rms for axis in axes):.4%}",
        f"{worst.relative_rms:.3%}",
        f"{worst.source}[{worst.axis}]",
        f"{statistics.median(axis.variance_difference for axis in axes):.5%}",
        f"{min(axis.fused_equal for axis in axes):.3%}",
        f"{min(axis.rejected_equal for axis in axes):.3%}",
        f"{min(one.flags_equal for one in results):.3%}",
        f"{sum(one.resets_equal for one in results)} of {len(results)} equal",
        f"{max(one.missing for one in results):.3%}",
        f"{sum(bool(beyond(release, one)) for one in results)} runs",
    ]
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    sys.exit(main())
