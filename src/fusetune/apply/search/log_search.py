"""A search on logs: they are saved and judged first, then searched on as `flight_search` does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from fusetune.analyze.analyze_flight import AnalysisSettings
from fusetune.apply.one_vehicle import decided_vehicle
from fusetune.apply.search.flight_search import FlightSearch, search_flights, trusted_flights
from fusetune.apply.search.settings import SearchSettings
from fusetune.apply.search.space import Space
from fusetune.apply.settings import DecisionSettings
from fusetune.design.factors import Factor, factors_around
from fusetune.design.tunable_parameters import DELAY_LIMIT
from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, ParameterError, check_value
from fusetune.px4.ulog.reader import file_checksum
from fusetune.save.flight_folder import METADATA_FILE, read_metadata
from fusetune.save.flights_table import write_flights_table
from fusetune.save.log_folder import demand_own_folders, save_log
from fusetune.save.present import find_present
from fusetune.storage.digest import source_digest
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.files import AnyPath, atomic_path

SEARCHED = (
    "EKF2_GPS_DELAY",
    "EKF2_GPS_POS_X",
    "EKF2_GPS_POS_Y",
    "EKF2_GPS_POS_Z",
    "EKF2_GPS_V_NOISE",
    "EKF2_ACC_NOISE",
    "EKF2_GYR_NOISE",
    "EKF2_BARO_NOISE",
    "EKF2_MAG_NOISE",
)
"""What is searched by default: what flights of simulated vehicles could tell (docs/search.md)."""

_LONGEST_DELAY_MS = 300.0


def search_logs(
    logs: Sequence[AnyPath],
    folder: AnyPath,
    settings: SearchSettings | None = None,
    *,
    decision: DecisionSettings | None = None,
    processes: int = 1,
    told: Callable[[str], None] = print,
) -> dict[str, Any]:
    """Search the parameters of the vehicle that flew the newest of some logs.

    Parameters
    ----------
    logs : ULog files, each with a file name of its own
    folder : takes all files; a search that was stopped goes on from them
    settings : of the search
    decision : how sets are compared, and when one is better
    processes : that replay
    told : is given lines about how far it is

    Returns
    -------
    What `search.json` holds

    Raises
    ------
    UserError
        No log can be used, or a parameter cannot be searched.
    """
    settings, decision, analysis = settings or SearchSettings(), decision or DecisionSettings(), AnalysisSettings()
    target = Path(folder)
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        folders = _saved(logs, target / "save", pool, told)
        table = target / "save" / "flights.parquet"
        rows = write_flights_table(list(folders.values()), table, table.with_suffix(".csv"))
        for row in rows:
            if row["status"] != "replayable":
                told(f"{row['flight']}: refused, {row['reason']}. {row['remedy']}.")
        names = settings.parameters or SEARCHED
        present = find_present(rows, folders, _varied(names), None)
        if present.flight is None:
            raise UserError(target, "none of the logs can be replayed", "The lines above say why, log by log")
        replayable = [row["flight"] for row in _in_time_order(rows) if row["status"] == "replayable"]
        others = decided_vehicle(table, replayable, present.flight).others
        own = {name: folders[name] for name in replayable if name not in others}
        for name in others:
            told(f"{name}: left out, it is of another vehicle")
        trusted, left_out = trusted_flights(own, analysis, decision.lowest_grade, pool)
        for name, why in left_out.items():
            told(f"{name}: left out, {why}")
    if not trusted:
        raise UserError(target, "no flight is replayed well enough to search on", "The lines above say why, log by log")
    values = read_metadata(folders[present.flight])["ekf2_parameters"]
    given = FlightSearch(
        flights={name: own[name] for name in trusted},
        left_out=left_out,
        flights_table=table,
        present_flight=present.flight,
        same_present=present.same,
        space=search_space(values, settings),
        search=settings,
        decision=decision,
        analysis=analysis,
    )
    return search_flights(given, target, processes, told)


def search_space(present: Mapping[str, float], settings: SearchSettings) -> Space:
    """What is searched around what the vehicle flies.

    Parameters
    ----------
    present : its EKF2 parameters, name → value

    Raises
    ------
    UserError
        A parameter is none of those that are tuned, or a bound is out of its range.
    """
    names = settings.parameters or SEARCHED
    try:
        # a longer delay brings a longer EKF2_DELAY_MAX along
        factors = factors_around({**present, DELAY_LIMIT: _LONGEST_DELAY_MS}, names, ratio=settings.ratio)
        bounded = tuple(_bounded(factor, settings.bounds.get(factor.parameter)) for factor in factors)
    except ParameterError as error:
        raise UserError(
            "search", str(error).removesuffix("."), "See docs/studies.md for all that can be searched"
        ) from error
    return Space(bounded, present.get(DELAY_LIMIT, PARAMETERS[DELAY_LIMIT].default))


def _bounded(factor: Factor, bounds: Sequence[float] | None) -> Factor:
    if bounds is None:
        return factor
    low, high = bounds
    for value in (low, high):
        check_value(factor.parameter, value)
    if not low < high:
        raise ParameterError(factor.parameter, f"its bounds {low:g} and {high:g} leave nothing between", "Mend them")
    return replace(factor, low=min(low, factor.origin), high=max(high, factor.origin))


def _varied(names: Sequence[str]) -> list[str]:
    """What has to be the same for two flights to have the same present set."""
    return [*names, DELAY_LIMIT]


def _in_time_order(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    return sorted(rows, key=lambda row: (row["recorded"] or "", row["flight"]))


def _saved(logs: Sequence[AnyPath], folder: Path, pool: Executor, told: Callable[[str], None]) -> dict[str, Path]:
    """Folders of the saved logs, by flight; those that stand as they were made from the same log stay."""
    paths = [Path(log) for log in logs]
    demand_own_folders(paths)
    told(f"saving {len(paths)} log{'s' if len(paths) > 1 else ''}")
    program = source_digest("px4", "ekf2/feed", "save")
    named = {path.stem: path for path in paths}
    outdated = [name for name, path in named.items() if not _is_saved(path, folder / name, program)]
    running = {name: pool.submit(save_log, named[name], folder / name) for name in outdated}
    for name, one in running.items():
        one.result()
        with atomic_path(_stamp(folder / name)) as temporary:
            write_document(temporary, {"program": program})
    return {name: folder / name for name in named}


def _is_saved(log: Path, folder: Path, program: str) -> bool:
    try:
        stamped = read_document(_stamp(folder))["program"] == program
        return bool(stamped and read_document(folder / METADATA_FILE)["checksum"] == file_checksum(log))
    except (UserError, KeyError):
        return False


def _stamp(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.made.json")
