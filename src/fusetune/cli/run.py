"""`fusetune run`."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from fusetune.cli.command import DONE, USER_ERROR
from fusetune.cli.output.json_document import add_json, print_document
from fusetune.cli.output.numbers import from_one
from fusetune.errors import UserError

if TYPE_CHECKING:
    from fusetune.configuration import Configuration
    from fusetune.running.workflow_events import Event

HELP = "run the whole pipeline: from logs to the parameters to load, and the page that says why"
EXAMPLES = (
    ("fusetune run ~/sdcard/log", "all logs of an SD card, from any folder; results/ appears in this one"),
    ("fusetune run", "what lies in flights/; while that is empty, simulated flights show what it does"),
    ("fusetune run --study my_sets.yaml", "compare the sets of a study"),
    ("fusetune run --config decision.confidence=0.9", "with another value of a setting"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Logs, where, with what, and how to tell."""
    parser.add_argument(
        "logs",
        type=Path,
        nargs="*",
        metavar="LOG",
        help="logs, or folders of logs, wherever they lie: links to them are put into flights/, beside what is there",
    )
    parser.add_argument("--cores", type=from_one, metavar="N", help="jobs at a time (all cores)")
    parser.add_argument(
        "--study", metavar="STUDY.yaml", help="sets to compare, docs/studies.md (a step around what flies)"
    )
    parser.add_argument(
        "--config", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="settings, config/README.md"
    )
    parser.add_argument(
        "--configfile", type=Path, metavar="FILE.yaml", help="settings that count before config/config.yaml"
    )
    parser.add_argument("--folder", type=Path, default=Path(), metavar="DIR", help="work there, not in this folder")
    parser.add_argument("--results", type=Path, metavar="DIR", help="keep the results there; results/ is a link to it")
    parser.add_argument("-n", "--dry-run", action="store_true", help="only tell what would be done")
    parser.add_argument(
        "--snakemake", default="", metavar="OPTIONS", help='options handed on, as in --snakemake="--forcerun decide"'
    )
    telling = parser.add_mutually_exclusive_group()
    telling.add_argument("-q", "--quiet", action="store_true", help="tell nothing but the end")
    telling.add_argument("-v", "--verbose", action="store_true", help="tell every job and all that Snakemake says")
    add_json(parser)
    parser.epilog = (
        "In a checkout it does what `snakemake --cores N` does. Exit status: 0 done, also where some logs were refused "
        "(the last lines say how many); 2 it could not be done, and one line says why; 130 interrupted: what is "
        "finished stays, and the next run goes on."
    )


def run(options: argparse.Namespace) -> int:
    """Run the workflow and tell the decision; `DONE`, or `USER_ERROR` with the reasons told."""
    from fusetune.cli.output.run_display import run_display
    from fusetune.cli.output.run_outcome import run_outcome, tell_outcome
    from fusetune.running.project_folder import RESULTS
    from fusetune.running.run_failures import RunFailures
    from fusetune.running.worker_processes import all_cores
    from fusetune.running.workflow_events import JobBegun
    from fusetune.running.workflow_files import workflow_file
    from fusetune.running.workflow_run import run_workflow

    folder = options.folder
    arguments = ["--cores", str(options.cores or all_cores()), *_asked(options)]
    made = _prepare(options, folder)
    if made and not (options.quiet or options.json):
        print(made, file=sys.stderr)
    failures = RunFailures(folder)
    display = run_display(quiet=options.quiet, verbose=options.verbose or options.dry_run)

    jobs = 0

    def take(told: Event | str) -> None:
        nonlocal jobs
        jobs += isinstance(told, JobBegun)
        failures.take(told)
        display.take(told)

    try:
        status = run_workflow(workflow_file(), folder, arguments, take)
    except KeyboardInterrupt:
        display.end()
        print("What is finished stays, and the next run goes on.", file=sys.stderr)
        raise
    finally:
        display.end()
    if status:
        for sentence in failures.sentences():
            print(f"fusetune: {sentence}", file=sys.stderr)
        return USER_ERROR
    if not jobs and not options.quiet:
        print("Nothing is out of date.", file=sys.stderr)
    if not options.dry_run:
        outcome = run_outcome(folder / RESULTS)
        if options.json:
            print_document(outcome.document())
        else:
            tell_outcome(outcome)
    return DONE


def _asked(options: argparse.Namespace) -> list[str]:
    """Options of Snakemake's."""
    from fusetune.settings.given_values import plain_entries

    asked = []
    if options.configfile is not None:
        asked += ["--configfile", os.path.abspath(options.configfile)]
    config = plain_entries(options.config)
    if options.study:
        config.append(f"study={_seen_from(options.folder, options.study)}")
    if config:
        asked += ["--config", *config]
    if options.dry_run:
        asked.append("--dry-run")
    try:
        return [*asked, *shlex.split(options.snakemake)]
    except ValueError as error:
        raise UserError("--snakemake", f"cannot be taken apart ({error})", "Mend its quotation marks") from error


def _seen_from(folder: Path, file: str) -> str:
    """A file as the workflow names it, which works in the folder: one that is moved has the same names in it."""
    path, place = Path(os.path.abspath(file)), Path(os.path.abspath(folder))
    return str(path.relative_to(place) if path.is_relative_to(place) else path)


def _prepare(options: argparse.Namespace, folder: Path) -> str:
    """Make what a run needs; says what was made."""
    for file in filter(None, (options.configfile, options.study)):
        if not Path(file).is_file():
            raise UserError(file, "is no file", "Mend the name")
    if options.dry_run and (options.logs or options.results):
        reason = "only tells, and links would have to be made for what is named beside it"
        raise UserError("--dry-run", reason, "Leave out logs and --results, or run")
    from fusetune.running.project_folder import FLIGHTS, link_results

    flights_dir = _settings(options, folder).flights_dir
    told = _link_logs(options.logs, folder, folder / flights_dir) if options.logs else ""
    folder.mkdir(parents=True, exist_ok=True)
    if flights_dir == FLIGHTS:
        (folder / flights_dir).mkdir(exist_ok=True)
    if options.results is not None:
        link_results(folder, options.results)
    return told


def _link_logs(logs: list[Path], folder: Path, flights: Path) -> str:
    """Bring logs into the folder of flights, which must be the folder's own; says what became of them."""
    from fusetune.apply.wording import counted
    from fusetune.save.linked_logs import link_logs

    if not Path(os.path.realpath(flights)).is_relative_to(os.path.realpath(folder)):
        reason = f"is where flights_dir has the logs, outside of {folder.resolve()}, and no links are put there"
        raise UserError(flights, reason, "Leave the logs out of the command, or set flights_dir: flights")
    linked = link_logs(logs, flights)
    told = [f"{counted(linked.linked, 'link')} put into {flights}" if linked.linked else ""]
    told += [f"{counted(linked.others, 'log')} there, not named, count as well" if linked.others else ""]
    return "; ".join(filter(None, told))


def _settings(options: argparse.Namespace, folder: Path) -> Configuration:
    """The configuration as the workflow will read it, but for what the command line sets."""
    from fusetune.configuration import read_configuration
    from fusetune.running.workflow_files import packaged_config

    own = folder / "config" / "config.yaml"
    files = [own if own.is_file() else packaged_config() / "config.yaml"]
    given = dict(one.partition("=")[::2] for one in options.config)
    flights = {"flights_dir": given["flights_dir"]} if "flights_dir" in given else None
    return read_configuration([*files, *([options.configfile] if options.configfile else [])], flights)
