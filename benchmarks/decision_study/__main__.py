"""Make the study and print its tables: `python -m benchmarks.decision_study`, from the project's root.

The tables of docs/decision.md and the figure in docs/images are renewed with `--write`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from .collect import Folders, StudyFiles, collect
from .figure import draw_power
from .study import Sizes, StudiedWorld, study_worlds
from .tables import (
    calibration_table,
    choices_table,
    false_changes_table,
    power_table,
    renew_tables,
    resampled_table,
    rules_table,
    truth_tables,
)

DOCUMENT, FIGURE = Path("docs/decision.md"), Path("docs/images/power.svg")


def main() -> None:
    """Run the study as the command line says."""
    options = _options()
    files = StudyFiles()
    folders = Folders(options.folder / "judged", options.folder / "saved", options.raw)
    flown = collect(files, options.pool, folders, options.workers, options.worlds or ())
    sizes = Sizes(options.flights, options.resamples, options.null_studies, options.intervals, options.quick_draws)
    worlds = study_worlds(flown, files.overrides(), sizes, options.workers)
    parts = _parts(worlds, options.pool, sizes)
    print("\n\n".join(parts.values()))
    if options.write:
        renew_tables(DOCUMENT, parts)
        draw_power([one for world in worlds for one in world.drawn], FIGURE)


def _parts(worlds: list[StudiedWorld], pool: int, sizes: Sizes) -> dict[str, str]:
    verdicts = [one for world in worlds for one in world.verdicts]
    drawn = [one for world in worlds for one in world.drawn]
    return {
        "rules": rules_table(verdicts),
        "choices": choices_table(verdicts),
        "resampled": resampled_table(drawn, sizes.resamples, pool),
        "power": power_table(drawn),
        "false changes": false_changes_table({one.name: one.false_changes for one in worlds}, sizes.null_studies),
        "calibration": calibration_table({one.name: one.covered for one in worlds}),
        "truth": truth_tables({one.name: one.truth for one in worlds}),
    }


def _options() -> argparse.Namespace:
    usual = Sizes()
    parser = argparse.ArgumentParser(prog="python -m benchmarks.decision_study", description=__doc__)
    parser.add_argument("--flights", type=int, default=usual.flights, help="flights of the study that is judged")
    parser.add_argument("--pool", type=int, default=16, help="flights that are flown in each world")
    parser.add_argument(
        "--resamples", type=int, default=usual.resamples, help="studies drawn of each kind and number of flights"
    )
    parser.add_argument(
        "--null-studies", type=int, default=usual.null_studies, help="studies of equal sets in each world"
    )
    parser.add_argument("--intervals", type=int, default=usual.intervals, help="studies whose intervals are judged")
    parser.add_argument(
        "--quick-draws", type=int, default=usual.quick_draws, help="bootstrap draws in the drawn studies"
    )
    parser.add_argument("--workers", type=int, default=2, help="processes that fly, replay, and judge")
    parser.add_argument("--worlds", nargs="*", help="names of worlds; by default all")
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path("results/decision_study"),
        help="where the flights are kept, in `judged` and `saved`",
    )
    parser.add_argument("--raw", type=Path, help="takes estimates, receiver and truth of every flight, for research")
    parser.add_argument("--write", action="store_true", help="renew docs/decision.md and docs/images/power.svg")
    return parser.parse_args()


if __name__ == "__main__":
    main()
