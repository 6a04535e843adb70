"""`fusetune plot`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fusetune.cli.command import DONE
from fusetune.errors import UserError

if TYPE_CHECKING:
    from fusetune.report.figures.asked_figures import Drawings
    from fusetune.report.figures.plotted_flight import PlottedFlight

HELP = "draw figures in the sizes of print, of a log or of a folder of results"
EXAMPLES = (
    ("fusetune plot flight.ulg --out figures", "every figure of a flight: innovations, states, flags, track"),
    ("fusetune plot flight.ulg --set EKF2_GPS_DELAY=160 --format pdf", "with another value beside, as one PDF"),
    ("fusetune plot results --figure 17 --size single", "all flights of a run: a figure of the paper, one column wide"),
    ("fusetune plot found --format pdf", "a search"),
    ("fusetune plot results --flight log_8 --figure innovations_gnss_vel --sets present,paper2", "one figure"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Log or results, which figures, and how they are written."""
    parser.add_argument("what", type=Path, metavar="LOG|RESULTS", help="log, or folder of results of a run or a search")
    parser.add_argument("--flight", metavar="NAME", help="of RESULTS, this flight instead of all together")
    parser.add_argument(
        "--sets", type=_names, default=(), metavar="NAME,…", help="sets to draw (what flies now, what is chosen)"
    )
    parser.add_argument(
        "--set",
        type=_values,
        default={},
        dest="values",
        metavar="NAME=VALUE,…",
        help="replay LOG with these parameters, too",
    )
    parser.add_argument(
        "--figure",
        action="append",
        default=[],
        metavar="NAME|N",
        help="this one alone, by name or by its number in the paper (5 to 20); may be given several times",
    )
    parser.add_argument("--format", choices=("svg", "pdf", "png"), default="svg", help="of the files (svg)")
    parser.add_argument(
        "--size", choices=("single", "double"), default="double", help="column that they fit: 85 or 178 mm (double)"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("figures"), metavar="DIR", help="folder of the files (figures)"
    )
    parser.epilog = (
        "As PDF all figures of a flight are the pages of one file, in the order of PX4's ecl_ekf analysis. Figures of "
        "the sensors (sensor_gyro, …, allan, spectra) are drawn when they are asked for."
    )


def run(options: argparse.Namespace) -> int:
    """Draw, and name the files; always `DONE`."""
    from fusetune.report.figures.asked_figures import flight_drawings, write_figures

    pages = ""
    if options.what.is_dir() and options.flight is None:
        drawings = _of_several(options.what, options.size)
    else:
        flight = _flight(options)
        if flight.why_not_replayed:
            print(f"Not replayed, so as the vehicle's own filter logged it: {flight.why_not_replayed}")
        drawings, pages = flight_drawings(flight, options.sets, options.size), flight.name
    for file in write_figures(drawings, options.figure, options.format, options.out, pages):
        print(file)
    return DONE


def _flight(options: argparse.Namespace) -> PlottedFlight:
    from fusetune.plotted_log import flight_of_log
    from fusetune.report.figures.plotted_flight import flight_of_results

    if not options.what.is_dir():
        if options.flight is not None:
            raise UserError(options.what, "is a log, which is one flight", "Leave out --flight")
        return flight_of_log(options.what, options.values)
    if options.values:
        raise UserError("--set", "the sets of results are replayed already", "Name them with --sets, or give a log")
    from fusetune.report.flight_data.shown_sets import Choice
    from fusetune.storage.documents import read_document

    folder = _folder(options.what)
    decision = read_document(folder / "apply" / "decision.json")
    chosen = decision["chosen"] if decision["chosen"] != decision["present"] else None
    return flight_of_results(folder, options.flight, options.sets, Choice(chosen=chosen))


def _of_several(path: Path, size: str) -> Drawings:
    """Of the flights that decide, or of a search."""
    from fusetune.report.figures.asked_figures import results_drawings, search_figures
    from fusetune.report.fleet.fleet_results import read_fleet_results
    from fusetune.report.flight_names import in_time_order
    from fusetune.report.results import read_results
    from fusetune.report.search_results import SEARCH_FILE, read_search
    from fusetune.storage.parquet import read_table

    if (path / SEARCH_FILE).is_file():
        return search_figures(read_search(path), size)
    folder = _folder(path)
    flights = in_time_order(read_table(folder / "save" / "flights.parquet").to_pylist())
    folders = [folder / "analyze" / name for name in flights]
    results = read_results([one for one in folders if (one / "scoring.json").exists()], folder / "apply")
    if not results.flights:
        raise UserError(path, "no flight has a say in the decision", "Name one flight with --flight")
    fleet, health = folder / "apply" / "fleet.json", folder / "analyze" / "health.parquet"
    told = read_fleet_results(fleet, health, {}) if fleet.is_file() and health.is_file() else None
    return results_drawings(results, told, size)


def _folder(path: Path) -> Path:
    """The results in a folder, or in `results` below it."""
    for folder in (path, path / "results"):
        if (folder / "apply" / "decision.json").is_file():
            return folder
    raise UserError(path, "holds no apply/decision.json", "Name the folder results of a run, or a log")


def _names(text: str) -> tuple[str, ...]:
    return tuple(one.strip() for one in text.split(",") if one.strip())


def _values(text: str) -> dict[str, float]:
    found: dict[str, float] = {}
    for one in _names(text):
        name, _, value = one.partition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError as error:
            raise argparse.ArgumentTypeError(f"{one!r} is not NAME=VALUE") from error
    return found
