"""Make the study and print its tables: `python -m benchmarks.diagnosis_study`, from the project's root.

Flights are kept below the folder, so that a study which is stopped goes on. The tables of docs/diagnosis.md are renewed
with `--write`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from .cases import HEALTHY, PAIRS, Case, case_of
from .flights import fly_case, is_flown
from .kinds import KINDS


def main() -> None:
    """Run the study as the command line says."""
    options = _options()
    flights = options.flights or options.folder / "flights"
    cases = list(_cases(options))
    for case in cases:
        if not is_flown(flights, case):
            print(fly_case(flights, case), flush=True)


def _cases(options: argparse.Namespace) -> Iterator[Case]:
    """All cases, the first ones of every kind first."""
    kinds: Sequence[str] = options.kinds if options.kinds is not None else list(KINDS)
    counts = dict.fromkeys(kinds, options.seeds) | {HEALTHY: options.healthy, PAIRS: options.pairs}
    largest = max(counts.values(), default=0)
    for number in range(largest):
        for group, count in counts.items():
            # Groups that are larger than a kind keep pace with the kinds.
            step = max(count // max(options.seeds, 1), 1)
            for one in range(number * step, min((number + 1) * step, count)):
                yield case_of(group, one)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.diagnosis_study", description=__doc__)
    parser.add_argument("--kinds", nargs="*", help="kinds of faults; by default all")
    parser.add_argument("--seeds", type=int, default=20, help="flights of each kind")
    parser.add_argument("--healthy", type=int, default=200, help="flights without a fault")
    parser.add_argument("--pairs", type=int, default=50, help="flights with two faults")
    parser.add_argument("--folder", type=Path, default=Path("results/diagnosis_study"), help="takes flights and verdicts")
    parser.add_argument("--flights", type=Path, help="where the flights are, if not there")
    return parser.parse_args()


if __name__ == "__main__":
    main()
