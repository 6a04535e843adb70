"""Make the study and print its tables: `python -m benchmarks.search_study`, from the project's root.

What was replayed is kept below the folder, so that a study which is stopped goes on, and one with more worlds makes
only what is new. The tables of docs/search.md are renewed with `--write`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from benchmarks.decision_study.tables import renew_tables

from fusetune.apply.settings import DecisionSettings
from fusetune.design.search_settings import SearchSettings

from .emulated import Emulator
from .emulated_studies import AS_IT_IS, NOISE_ONLY, Outcome, search_often
from .found_sets import JudgedWorld, WorldSearch
from .tables import emulated_table, found_table, wrong_table
from .tried_sets import sets_to_try, table_space, try_sets
from .worlds import FRESH, search_worlds

DOCUMENT = Path("docs/search.md")
EMULATED = ("near_optimum", "base", "receiver_like")
EMULATED_FLIGHTS = (8, 5)
QUICK_DRAWS = 200


def main() -> None:
    """Run the study as the command line says."""
    options = _options()
    known = search_worlds(options.saved or options.folder / "saved")
    names = options.worlds or list(known)
    parts = {}
    with ProcessPoolExecutor(options.workers) as pool:
        once = partial(_judged, options.folder, options.saved, SearchSettings(evaluations=options.evaluations))
        worlds = list(pool.map(once, names))
    parts["found"] = found_table(worlds)
    parts["wrong"] = wrong_table([one for one in worlds if one.right])
    if options.emulated:
        outcomes = _emulated(options, [one for one in worlds if one.name in EMULATED])
        parts["emulated"] = emulated_table(outcomes)
    print("\n\n".join(parts.values()))
    if options.write:
        renew_tables(DOCUMENT, parts)


def _search(folder: Path, saved: Path | None, settings: SearchSettings, name: str) -> WorldSearch:
    return WorldSearch(search_worlds(saved or folder / "saved")[name], folder, settings, DecisionSettings())


def _judged(folder: Path, saved: Path | None, settings: SearchSettings, name: str) -> JudgedWorld:
    found = _search(folder, saved, settings, name).judged()
    print(found_table([found]).splitlines()[-1], flush=True)
    return found


def _emulated(options: argparse.Namespace, worlds: Sequence[JudgedWorld]) -> dict[tuple[str, str, int], list[Outcome]]:
    """Searches around the present set, with noise only and as it is, and around the truth's best set."""
    settings = SearchSettings(evaluations=options.emulated_evaluations)
    decision = DecisionSettings(draws=QUICK_DRAWS)
    outcomes = {}
    for world in worlds:
        search = _search(options.folder, options.saved, settings, world.name)
        space = table_space(search.space)
        sets = sets_to_try(space, world.oracle.values, options.table_sets, settings.seed)
        table = try_sets(search.replays(), search.names[: max(FRESH) + 1], space, sets)
        best = space.around(world.oracle.values)
        for kind, around, how in (
            ("any, noise only", space, NOISE_ONLY),
            ("the truth's best", best, AS_IT_IS),
            ("as it is", space, AS_IT_IS),
        ):
            for flights in EMULATED_FLIGHTS:
                outcomes[world.name, kind, flights] = search_often(
                    Emulator(table), around, settings, decision, how, flights, options.emulated, options.workers
                )
    return outcomes


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.search_study", description=__doc__)
    parser.add_argument("--worlds", nargs="*", help="names of worlds; by default all")
    parser.add_argument("--evaluations", type=int, default=SearchSettings().evaluations, help="of each search")
    parser.add_argument("--emulated", type=int, default=200, help="searches of each kind on emulated flights; 0: none")
    parser.add_argument("--emulated-evaluations", type=int, default=200, help="of each of these")
    parser.add_argument("--table-sets", type=int, default=64, help="a third of the sets that these are emulated from")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument(
        "--folder", type=Path, default=Path("results/search_study"), help="takes flights and what was replayed"
    )
    parser.add_argument("--saved", type=Path, help="where saved flights are, if not there")
    parser.add_argument("--write", action="store_true", help="renew docs/search.md")
    return parser.parse_args()


if __name__ == "__main__":
    main()
