"""CPU time of all metrics of one flight, per parameter set, and the share of each part.

    python benchmarks/metrics_speed.py SAVED_FLIGHT REPLAYS SET [SET …]

`SAVED_FLIGHT` is a folder of `results/save`, `REPLAYS` the folder of its replays in `results/analyze`; the first set
is the present one. The outputs go to a temporary folder. Imports do not count. Parts overlap where one calls another:
`other` is what no part accounts for.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fusetune.analyze.scoring import sample_scores, score_flight, set_scores, yardstick

MODULES = (score_flight, set_scores, sample_scores, yardstick)

REPEATS = 5

PARTS = {
    "reading the flight": ("load_flight", "canonical"),
    "reading the replays": ("read_set",),
    "scored part of the flight": ("scoring_window", "ground_window"),
    "pairing measurements": ("counted", "counted_of_its_own", "sample_masks"),
    "figures of axes and groups": ("add_innovation_metrics",),
    "blocks": ("block_sums", "block_rows"),
    "windows": ("window_figures", "window_rows", "add_worst_windows"),
    "ground": ("add_ground_metrics", "add_ground_events"),
    "whiteness of the sources": ("source_whiteness", "add_whiteness"),
    "smoothed velocity": ("smoothed_velocity", "velocity_differences", "smoothed_rows"),
    "true errors": ("read_references", "true_errors", "add_true_errors"),
    "gaps": ("gap_masks", "counted_gaps", "add_withheld_metrics", "withheld_rows", "add_true_drift"),
    "events and activity": ("reset_jumps", "filter_events", "set_summary"),
    "as flown": ("onboard_samples", "write_onboard"),
    "writing": ("scores_writer",),
}
"""Part → functions that the modules call by these names."""


def timed(function: Callable[..., Any], spent: dict[str, float], part: str) -> Callable[..., Any]:
    """The function, adding the CPU time of its calls to `spent[part]`."""

    def wrapper(*arguments: Any, **named: Any) -> Any:
        start = time.process_time()
        try:
            return function(*arguments, **named)
        finally:
            spent[part] += time.process_time() - start

    return wrapper


def measure(flight: Path, replays: Path, sets: list[str]) -> tuple[float, dict[str, float]]:
    """CPU seconds of one scoring, and of its parts."""
    spent: dict[str, float] = defaultdict(float)
    originals = [
        (module, name, getattr(module, name), part)
        for part, names in PARTS.items()
        for name in names
        for module in MODULES
        if hasattr(module, name)
    ]
    for module, name, original, part in originals:
        setattr(module, name, timed(original, spent, part))
    try:
        with tempfile.TemporaryDirectory() as folder:
            for file in replays.iterdir():
                if file.name.split(".")[0] in sets:
                    (Path(folder) / file.name).symlink_to(file.resolve())
            start = time.process_time()
            score_flight.score_saved_flight(flight, Path(folder), sets, present=sets[0])
            return time.process_time() - start, spent
    finally:
        for module, name, original, _ in originals:
            setattr(module, name, original)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("flight", type=Path)
    parser.add_argument("replays", type=Path)
    parser.add_argument("sets", nargs="+")
    options = parser.parse_args()
    for sets in (options.sets[:1], options.sets):
        measure(options.flight, options.replays, sets)
        runs = [measure(options.flight, options.replays, sets) for _ in range(REPEATS)]
        total = statistics.median(run[0] for run in runs)
        print(f"{len(sets)} set(s): {total:.3f} s of CPU, {total / len(sets):.3f} s per set")
    print("\nshares with all sets:")
    shares = {part: statistics.median(run[1][part] for run in runs) / total for part in PARTS}
    shares["other"] = 1.0 - sum(shares.values())
    for part, share in sorted(shares.items(), key=lambda item: -item[1]):
        print(f"  {part:28s} {100.0 * share:5.1f} %")


if __name__ == "__main__":
    main()
