"""A search on logs: they are saved and judged first, then searched on as `flight_search` does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from fusetune.analyze.analyze_flight import AnalysisSettings
from fusetune.apply.search.flight_search import FlightSearch, search_flights
from fusetune.apply.search.flights_to_search import flights_to_search
from fusetune.apply.search.plan import fewest_sets
from fusetune.apply.search.search_folder import demand_search_folder
from fusetune.apply.search.search_space import demand_searchable, search_space
from fusetune.apply.settings import DecisionSettings
from fusetune.design.search_settings import SearchSettings
from fusetune.errors import UserError
from fusetune.px4.ulog.reader import file_checksum
from fusetune.running.worker_processes import worker_processes
from fusetune.save.flight_folder import METADATA_FILE
from fusetune.save.flights_table import write_flights_table
from fusetune.save.log_folder import demand_own_folders, save_log
from fusetune.save.present import find_present
from fusetune.storage.digest import source_digest
from fusetune.storage.files import AnyPath
from fusetune.storage.ledger import Ledger, key_of


def search_logs(
    logs: Sequence[AnyPath],
    folder: AnyPath,
    settings: SearchSettings | None = None,
    *,
    decision: DecisionSettings | None = None,
    analysis: AnalysisSettings | None = None,
    processes: int = 1,
    told: Callable[[str], None] = print,
    asked_in: AnyPath = "search",
) -> dict[str, Any]:
    """Search the parameters of the vehicle that flew the newest of some logs.

    Parameters
    ----------
    logs : ULog files, each with a file name of its own
    folder : takes all files; a search that was stopped goes on from them
    settings : of the search
    decision : how sets are compared, and when one is better
    analysis : how flights are replayed and scored
    processes : that replay
    told : is given lines about how far it is
    asked_in : file that the settings come from, for errors

    Returns
    -------
    What `search.json` holds

    Raises
    ------
    UserError
        No log can be used, a parameter cannot be searched, or the folder holds what is no search's.
    """
    settings, decision = settings or SearchSettings(), decision or DecisionSettings()
    analysis = analysis or AnalysisSettings()
    target = Path(folder)
    demand_searchable(settings, asked_in)
    demand_search_folder(target)
    with worker_processes(processes) as pool:
        folders = _saved(logs, target / "save", pool, told)
        table = target / "save" / "flights.parquet"
        rows = write_flights_table(list(folders.values()), table, table.with_suffix(".csv"))
        for row in rows:
            if row["status"] != "replayable":
                told(f"{row['flight']}: refused, {row['reason']}. {row['remedy']}.")
        present = find_present(rows, folders, settings.varied, None)
        if present.flight is None:
            raise UserError(target, "none of the logs can be replayed", "The lines above say why, log by log")
        searched = flights_to_search(folders, table, present.flight, settings, decision, analysis, pool.map)
        for name, why in searched.left_out.items():
            told(f"{name}: left out, {why}")
    if not searched.flights:
        raise UserError(target, "no flight is replayed well enough to search on", "The lines above say why, log by log")
    space = search_space(searched.vehicle, searched.parameters, settings, asked_in)
    fewest = fewest_sets(space, settings)
    if settings.evaluations < fewest:
        told(f"{settings.evaluations} sets are too few for {len(space.factors)} parameters: {fewest} are tried")
    given = FlightSearch(
        flights={name: folders[name] for name in searched.flights},
        left_out=searched.left_out,
        flights_table=table,
        present_flight=present.flight,
        same_present=present.same,
        present_values=present.parameters,
        space=space,
        search=settings,
        decision=decision,
        analysis=analysis,
    )
    return search_flights(given, target, processes, told)


def _saved(logs: Sequence[AnyPath], folder: Path, pool: Executor, told: Callable[[str], None]) -> dict[str, Path]:
    """Folders of the saved logs, by flight; those that stand as they were made from the same log stay."""
    paths = [Path(log) for log in logs]
    demand_own_folders(paths)
    told(f"saving {len(paths)} log{'s' if len(paths) > 1 else ''}")
    program = source_digest("px4", "ekf2/feed", "ekf2/releases", "save")
    named = {path.stem: path for path in paths}
    ledger = Ledger(folder / ".made.json")
    # the log of a flight that cannot be read gets a folder that says why
    keys = {name: key_of([_checksum(path), program]) for name, path in named.items()}
    outdated = [name for name in named if not ledger.is_current(name, keys[name], [folder / name / METADATA_FILE])]
    running = {name: pool.submit(save_log, named[name], folder / name) for name in outdated}
    for name, one in running.items():
        one.result()
        ledger.record(name, keys[name], [folder / name / METADATA_FILE])
    return {name: folder / name for name in named}


def _checksum(log: Path) -> str:
    try:
        return file_checksum(log)
    except UserError:
        return ""
