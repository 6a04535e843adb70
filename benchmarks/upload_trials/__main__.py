"""`python -m benchmarks.upload_trials [--share S] [--kind WORD]`: the table of docs/upload.md.

Ends with 1 where an upload left something wrong on a vehicle, or ended as it may not.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from statistics import median

from benchmarks.upload_trials.trials import KINDS, PACE, Trial


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=1.0, help="of the tries of each kind (1)")
    parser.add_argument("--kind", default="", help="only kinds whose name holds this")
    parser.add_argument("--seed", type=int, default=1, help="of the first try (1)")
    options = parser.parse_args()
    bad = 0
    print(f"times are {1 / PACE:.0f} times as fast as a vehicle's, and told by its clock")
    print(f"{'what':22} {'tries':>5}  {'how they ended':38} {'s, median (most)':>18} {'asked again':>12} "
          f"{'resumed':>7} {'reboots':>7} {'writes':>6} {'armed':>5} {'wrong':>5} {'since s':>7}")  # fmt: skip
    for name, (count, run, allowed) in KINDS.items():
        if options.kind not in name:
            continue
        trials = [run(options.seed + number) for number in range(max(1, round(count * options.share)))]
        bad += sum(bool(one.wrong) or one.outcome not in allowed for one in trials)
        print(_row(name, trials), flush=True)
        for number, one in enumerate(trials):
            if one.wrong or one.outcome not in allowed:
                print(f"  seed {options.seed + number}: {one.outcome}; {'; '.join(one.wrong[:3])}")
                print("\n".join(f"    {line}" for line in one.told))
    return 1 if bad else 0


def _row(name: str, trials: list[Trial]) -> str:
    ended = ", ".join(f"{count} {outcome}" for outcome, count in Counter(one.outcome for one in trials).most_common())
    seconds = [one.seconds for one in trials]
    retries = [one.retries for one in trials]
    return (
        f"{name:22} {len(trials):5}  {ended:38} {f'{median(seconds):.0f} ({max(seconds):.0f})':>18} "
        f"{f'{median(retries):.0f} ({max(retries)})':>12} {sum(one.resumed for one in trials):7} "
        f"{sum(one.reboots for one in trials):7} {sum(one.sets for one in trials):6} "
        f"{sum(one.sets_while_armed for one in trials):5} {sum(len(one.wrong) for one in trials):5} "
        f"{max(one.armed_s for one in trials):7.2f}"
    )


if __name__ == "__main__":
    sys.exit(main())
