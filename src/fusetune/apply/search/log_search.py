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
from fusetune.apply.search.plan import PUTTING_BACK_ROUNDS, plan_of
from fusetune.apply.search.settings import FEWEST_EVALUATIONS, SearchSettings
from fusetune.apply.search.space import Space
from fusetune.apply.settings import DecisionSettings
from fusetune.design.around_present import not_exercised
from fusetune.design.factors import Factor, factors_around
from fusetune.design.tunable_parameters import DELAY_LIMIT
from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, ParameterError, check_value
from fusetune.px4.ulog.reader import file_checksum
from fusetune.save.exercise import exercise_of
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
    "EKF2_EV_DELAY",
    "EKF2_EVP_NOISE",
    "EKF2_EVV_NOISE",
    "EKF2_OF_DELAY",
    "EKF2_OF_N_MIN",
    "EKF2_RNG_NOISE",
)
"""What is searched by default, as far as the flights exercise it: what flights of simulated vehicles could tell
(docs/search.md), and the like of other sensors."""

_LONGEST_DELAY_MS = 300.0

_MARK = ".search.json"
"""Marks a folder as that of a search."""


def search_logs(
    logs: Sequence[AnyPath],
    folder: AnyPath,
    settings: SearchSettings | None = None,
    *,
    decision: DecisionSettings | None = None,
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
    processes : that replay
    told : is given lines about how far it is
    asked_in : file that the settings come from, for errors

    Returns
    -------
    What `search.json` holds

    Raises
    ------
    UserError
        No log can be used, a parameter cannot be searched, there are fewer evaluations than parameters need, or the
        folder holds what is no search's.
    """
    settings, decision, analysis = settings or SearchSettings(), decision or DecisionSettings(), AnalysisSettings()
    target = Path(folder)
    demand_searchable(settings, asked_in)
    demand_search_folder(target)
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
        values = read_metadata(folders[present.flight])["ekf2_parameters"]
        if settings.parameters:
            search_space(values, names, settings, asked_in)  # a mistake is told before it costs time
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
    if not settings.parameters:
        exercises = [exercise_of(own[name]) for name in trusted]
        names = tuple(name for name in SEARCHED if not not_exercised(name, exercises))
    given = FlightSearch(
        flights={name: own[name] for name in trusted},
        left_out=left_out,
        flights_table=table,
        present_flight=present.flight,
        same_present=present.same,
        space=search_space(values, names, settings, asked_in),
        search=settings,
        decision=decision,
        analysis=analysis,
    )
    return search_flights(given, target, processes, told)


def search_space(
    present: Mapping[str, float], names: Sequence[str], settings: SearchSettings, asked_in: AnyPath = "search"
) -> Space:
    """What is searched around what the vehicle flies.

    Parameters
    ----------
    present : its EKF2 parameters, name → value
    names : of those that are searched
    asked_in : file that the settings come from, for errors

    Raises
    ------
    UserError
        A parameter is none of those that are tuned, a bound is out of its range or of a parameter that is not searched,
        or there are fewer evaluations than so many parameters need.
    """
    idle = [name for name in settings.bounds if name not in names]
    if idle:
        raise UserError(
            asked_in,
            f"gives bounds of {', '.join(idle)}, of which these flights cannot tell, or which is not to be searched",
            f"Searched are {', '.join(names)}; leave out the others' bounds",
        )
    try:
        # a longer delay brings a longer EKF2_DELAY_MAX along
        factors = factors_around({**present, DELAY_LIMIT: _LONGEST_DELAY_MS}, names, ratio=settings.ratio)
        bounded = tuple(_bounded(factor, settings.bounds.get(factor.parameter)) for factor in factors)
    except ParameterError as error:
        raise _parameter_error(error, asked_in) from error
    space = Space(bounded, present.get(DELAY_LIMIT, PARAMETERS[DELAY_LIMIT].default))
    fewest = fewest_evaluations(space, settings)
    if settings.evaluations < fewest:
        raise UserError(
            asked_in,
            f"asks for {settings.evaluations} evaluations, too few for {len(names)} parameters",
            f"Give at least {fewest} (--evaluations), or search fewer parameters",
        )
    return space


def fewest_evaluations(space: Space, settings: SearchSettings) -> int:
    """Sets that the smallest search of a space tries."""
    smallest = plan_of(space, replace(settings, evaluations=FEWEST_EVALUATIONS))
    # each round of putting back asks once more for a set that is known
    planned = sum(size for _, size in smallest.rounds) - PUTTING_BACK_ROUNDS
    return max(planned, FEWEST_EVALUATIONS)


def demand_searchable(settings: SearchSettings, asked_in: AnyPath) -> None:
    """See that all parameters and bounds are of those that can be tuned, before anything is begun.

    Raises
    ------
    UserError
        One is not.
    """
    for name in (*settings.parameters, *settings.bounds):
        try:
            factors_around({}, [name])
        except ParameterError as error:
            raise _parameter_error(error, asked_in) from error


def demand_search_folder(folder: Path) -> None:
    """See that a folder is new, empty, or of a search, and mark it as that.

    Raises
    ------
    UserError
        It holds other files, which the search would mix with its own or overwrite.
    """
    mark = folder / _MARK
    if folder.exists() and not folder.is_dir():
        raise UserError(folder, "is a file, and the search needs a folder", "Name another folder (--out)")
    if not mark.exists():
        found = [one.name for one in folder.iterdir()] if folder.is_dir() else []
        # hidden files: a mark that was being written, what file managers leave
        other = min((name for name in found if not name.startswith(".")), default=None)
        if other is not None:
            raise UserError(
                folder,
                f"holds files that are no search's ({other})",
                "Name a new or an empty folder, or that of a search which was stopped (--out)",
            )
        with atomic_path(mark) as temporary:
            write_document(temporary, {"holds": "a search of parameters, which goes on from what is kept here"})


def _parameter_error(error: ParameterError, asked_in: AnyPath) -> UserError:
    remedy = f"{error.remedy.removesuffix('.')}; docs/studies.md lists all that can be searched"
    return UserError(asked_in, f"{error.name}: {error.reason}", remedy)


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
