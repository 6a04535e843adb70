"""Replay every reference flight with every reference set and print how close the replay is, as Markdown.

    python -m benchmarks.fidelity_table                                    # the golden flights of the project
    python -m benchmarks.fidelity_table LOGS_DIR REFERENCE_DIR > table.md
    python -m benchmarks.fidelity_table LOGS_DIR RANDOM_REFERENCE_DIR --by-set > table.md

REFERENCE_DIR holds one folder per log (its stem), with what PX4's own estimator computed, as docs/fidelity.md
describes it. A line stands for a flight with all its sets, or with `--by-set` for a single set: where sets are drawn at
random, each asks something else of the estimator. A flight that cannot be compared says why, and the status is 1.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from benchmarks.reference_flights import GOLDEN_LOGS, GOLDEN_REFERENCE, log_of, reference_folders

from fusetune.analyze.replaying.replay_log import replay_log
from fusetune.analyze.trust.fidelity import ReplayFidelity, compare_folders, order_agreement
from fusetune.errors import UserError

HEADER = (
    "| flight | sets | RMS diff., median | worst | worst axis | variance | decisions equal | flags equal | resets | "
    "velocity mm/s | attitude ° | gyro bias rad/s | NLL | Kendall τ |"
)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.fidelity_table",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("logs", type=Path, nargs="?", default=GOLDEN_LOGS)
    parser.add_argument("reference", type=Path, nargs="?", default=GOLDEN_REFERENCE)
    parser.add_argument("--by-set", action="store_true", help="a line for each parameter set")
    parser.add_argument("--skip", metavar="FLIGHT", action="append", default=[], help="leave a flight out")
    options = parser.parse_args(arguments)
    if (options.logs == GOLDEN_LOGS) != (options.reference == GOLDEN_REFERENCE):
        parser.error("name both folders, or none for the golden flights")
    try:
        folders = [path for path in reference_folders(options.reference) if path.name not in options.skip]
    except UserError as error:
        parser.exit(2, f"{error}\n")
    print(HEADER)
    print("|---" * HEADER.count(" | ") + "|---|")
    everything: list[ReplayFidelity] = []
    failed = False
    for folder in folders:
        try:
            results = compared(folder, options.logs)
        except UserError as error:
            print(f"| {folder.name} | – | {error} " + "| – " * 11 + "|", flush=True)
            failed = True
            continue
        everything += results
        lines = [(f"{folder.name} {one.set}", [one]) for one in results] if options.by_set else [(folder.name, results)]
        for name, line in lines:
            print(row(name, line), flush=True)
    print(row("**all**", everything, with_order=False))
    return int(failed)


def compared(reference: Path, logs: Path) -> list[ReplayFidelity]:
    """Replay every set of one flight's reference on its log, and compare.

    Raises
    ------
    UserError
        The log, or a file of the reference, is missing or damaged.
    """
    with tempfile.TemporaryDirectory() as scratch:
        log = log_of(reference.name, logs, Path(scratch))
        replays = Path(scratch) / "replays"
        replay_log(log, reference, replays)
        return compare_folders(reference, replays)


def row(name: str, results: list[ReplayFidelity], *, with_order: bool = True) -> str:
    """One line of the table: medians and worst cases over the sets of a flight."""
    axes = [axis for result in results for axis in result.axes]
    if not axes:
        return f"| {name} | {len(results)} | no sample of a compared source " + "| – " * 11 + "|"
    worst = max(axes, key=lambda axis: axis.relative_rms)
    tau = order_agreement(results) if with_order else math.nan
    cells = [
        name,
        str(len(results)),
        f"{statistics.median(axis.relative_rms for axis in axes):.4%}",
        f"{worst.relative_rms:.3%}",
        f"{worst.source}[{worst.axis}]",
        f"{max(axis.variance_difference for axis in axes):.4%}",
        f"{min(min(axis.fused_equal, axis.rejected_equal) for axis in axes):.3%}",
        f"{least(result.flags_equal for result in results):.3%}",
        "equal" if all(result.resets_equal for result in results) else "differ",
        f"{1e3 * largest(result.velocity_rms for result in results):.3f}",
        f"{largest(result.attitude_rms_deg for result in results):.4f}",
        f"{largest(result.gyro_bias_rms for result in results):.1e}",
        f"{max(axis.nll_difference for axis in axes):.4f}",
        f"{tau:.2f}" if math.isfinite(tau) else "–",
    ]
    return "| " + " | ".join(cells) + " |"


def least(values: Iterable[float]) -> float:
    return min((value for value in values if math.isfinite(value)), default=math.nan)


def largest(values: Iterable[float]) -> float:
    return max((value for value in values if math.isfinite(value)), default=math.nan)


if __name__ == "__main__":
    sys.exit(main())
