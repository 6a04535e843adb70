"""Make the study and print its tables: `python -m benchmarks.diagnosis_study`, from the project's root.

Flights and what was said of them are kept below the folder, so that a study which is stopped goes on, and only what a
change of the sources touches is asked again. The tables of docs/diagnosis.md are renewed with `--write`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from benchmarks.decision_study.tables import renew_tables

from .cases import CALM, HEALTHY, PAIRS, Case, case_of
from .estimates import estimates_table
from .flights import fly_case, is_flown
from .kinds import KINDS
from .tables import study_tables
from .verdicts import verdicts

SEEDS, HEALTHIES, CALMS, PAIRED = 20, 200, 20, 50
"""How many flights of each kind and group there were when levels were set; what comes after had no say."""
DOCUMENT = Path("docs/diagnosis.md")


def main() -> None:
    """Run the study as the command line says."""
    options = _options()
    flights = options.flights or options.folder / "flights"
    cases = list(_cases(options))
    for case in cases:
        if not is_flown(flights, case):
            print(fly_case(flights, case), flush=True)
    if options.fly_only:
        return
    found = list(verdicts(flights, options.folder / "verdicts", cases, causes_only=options.causes_only))
    estimates = None if options.causes_only else estimates_table(found)
    tables = study_tables(found, estimates, fresh=options.fresh)
    print("\n\n".join(tables.values()))
    if options.write:
        renew_tables(DOCUMENT, tables)


def _cases(options: argparse.Namespace) -> Iterator[Case]:
    """All cases, the first ones of every group first; larger groups keep pace with the kinds."""
    counts = dict.fromkeys(options.kinds, options.seeds)
    counts |= {HEALTHY: options.healthy, CALM: options.calm, PAIRS: options.pairs}
    after = dict.fromkeys(counts, 0)
    if options.fresh:
        after = dict.fromkeys(options.kinds, SEEDS) | {HEALTHY: HEALTHIES, CALM: CALMS, PAIRS: PAIRED}
    rounds = max(options.seeds, 1)
    for number in range(rounds):
        for group, count in counts.items():
            for one in range(count * number // rounds, count * (number + 1) // rounds):
                yield case_of(group, after[group] + one)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.diagnosis_study", description=__doc__)
    parser.add_argument(
        "--kinds", nargs="*", choices=list(KINDS), default=list(KINDS), help="of faults; by default all"
    )
    parser.add_argument("--seeds", type=int, default=SEEDS, help="flights of each kind")
    parser.add_argument("--healthy", type=int, default=HEALTHIES, help="flights without a fault")
    parser.add_argument("--calm", type=int, default=CALMS, help="flights for drag, in calm air")
    parser.add_argument("--pairs", type=int, default=PAIRED, help="flights with two faults")
    parser.add_argument(
        "--fresh", action="store_true", help="flights that had no say when levels were set: those after the usual ones"
    )
    parser.add_argument(
        "--folder", type=Path, default=Path("results/diagnosis_study"), help="takes flights and what was said of them"
    )
    parser.add_argument("--flights", type=Path, help="where the flights are, if not there")
    parser.add_argument("--fly-only", action="store_true", help="make the flights and ask nothing")
    parser.add_argument(
        "--causes-only", action="store_true", help="ask no tuner; the table of their values stays as it is"
    )
    parser.add_argument("--write", action="store_true", help="renew docs/diagnosis.md")
    return parser.parse_args()


if __name__ == "__main__":
    main()
