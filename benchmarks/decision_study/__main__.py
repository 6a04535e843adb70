"""Make the study and print its tables: `python -m benchmarks.decision_study`, from the project's root.

The tables of docs/decision.md are renewed with `--write`.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from fusetune.apply.settings import DecisionSettings

from .collect import StudyFiles, collect
from .judge import changes_among_twins, coverage, false_changes, judge_all, resample
from .tables import between_marks, calibration_table, choices_table, resampled_table, rules_table, truth_tables
from .world import read_world

SEED = 20


def main() -> None:
    """Run the study as the command line says."""
    options = _options()
    files = StudyFiles()
    folders = collect(files, options.pool, options.folder, options.workers)
    settings = DecisionSettings(seed=SEED)
    quick = replace(settings, draws=options.quick_draws)
    worlds = [read_world(name, paths, files.overrides(), settings) for name, paths in folders.items()]
    verdicts = judge_all(worlds, options.flights, settings)
    parts = {
        "rules": rules_table(verdicts),
        "choices": choices_table(verdicts),
        "resampled": resampled_table(
            resample(worlds, options.flights, options.resamples, quick, np.random.default_rng(SEED)), options
        ),
        "calibration": calibration_table(
            coverage(worlds, options.flights, options.resamples, quick, np.random.default_rng(SEED)),
            changes_among_twins(worlds, options.flights, options.resamples, quick, np.random.default_rng(SEED)),
            false_changes(worlds, options.flights, options.null_studies, quick, np.random.default_rng(SEED)),
        ),
        "truth": truth_tables(worlds),
    }
    print("\n\n".join(parts.values()))
    if options.write:
        document = Path("docs/decision.md")
        text = document.read_text(encoding="utf-8")
        for name, table in parts.items():
            text = between_marks(text, name, table)
        document.write_text(text, encoding="utf-8")


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.decision_study", description=__doc__)
    parser.add_argument("--flights", type=int, default=8, help="flights of a study")
    parser.add_argument("--pool", type=int, default=16, help="flights that are flown in each world")
    parser.add_argument("--resamples", type=int, default=40, help="studies drawn from the pool of each world")
    parser.add_argument("--null-studies", type=int, default=200, help="studies of equal sets in each world")
    parser.add_argument("--quick-draws", type=int, default=400, help="bootstrap draws in the drawn studies")
    parser.add_argument("--workers", type=int, default=2, help="processes that fly and replay")
    parser.add_argument(
        "--folder", type=Path, default=Path("results/decision_study"), help="where the flights are kept"
    )
    parser.add_argument("--write", action="store_true", help="renew the tables of docs/decision.md")
    return parser.parse_args()


if __name__ == "__main__":
    main()
