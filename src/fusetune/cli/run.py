"""`fusetune run`."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

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

RESULTS = Path("results")


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
    parser.add_argument("--study", metavar="FILE", help="sets to compare, docs/studies.md (a step around what flies)")
    parser.add_argument(
        "--config", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="settings, config/README.md"
    )
    parser.add_argument("--configfile", type=Path, metavar="FILE", help="settings that count before config/config.yaml")
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
    from fusetune.running.run_failures import RunFailures
    from fusetune.running.worker_processes import all_cores
    from fusetune.running.workflow_files import workflow_file
    from fusetune.running.workflow_run import run_workflow

    folder = options.folder
    made = _prepare(options, folder)
    if made and not (options.quiet or options.json):
        print(made, file=sys.stderr)
    failures, display = (
        RunFailures(folder),
        run_display(quiet=options.quiet, verbose=options.verbose or options.dry_run),
    )
    arguments = ["--cores", str(options.cores or all_cores()), *_asked(options)]
    decided_before = _decision_bytes(folder)

    def take(told: Event | str) -> None:
        failures.take(told)
        display.take(told)

    try:
        status = run_workflow(workflow_file(), folder, arguments, take)
    finally:
        display.end()
    if status:
        for sentence in failures.sentences():
            print(f"fusetune: {sentence}", file=sys.stderr)
        return USER_ERROR
    if not options.dry_run:
        _tell_end(folder, options.json, is_same=_decision_bytes(folder) == decided_before)
    return DONE


def _asked(options: argparse.Namespace) -> list[str]:
    """Options of Snakemake's."""
    asked = []
    if options.configfile is not None:
        asked += ["--configfile", os.path.abspath(options.configfile)]
    for text in options.config:
        if "=" not in text:
            raise UserError("--config", f"{text!r} is not KEY=VALUE", "Put logs before --config, or behind --")
    config = [*options.config, *([f"study={os.path.abspath(options.study)}"] if options.study else [])]
    if config:
        asked += ["--config", *config]
    if options.dry_run:
        asked.append("--dry-run")
    try:
        return [*asked, *shlex.split(options.snakemake)]
    except ValueError as error:
        raise UserError("--snakemake", f"cannot be taken apart ({error})", "Mend its quotation marks") from error


def _prepare(options: argparse.Namespace, folder: Path) -> str:
    """Make what a run needs; says what was made."""
    for file in filter(None, (options.configfile, options.study)):
        if not Path(file).is_file():
            raise UserError(file, "is no file", "Mend the name")
    folder.mkdir(parents=True, exist_ok=True)
    if options.results is not None:
        _link_results(folder, options.results)
    flights = folder / _settings(options, folder).flights_dir
    if not options.logs:
        is_default = Path(flights.name) == flights.relative_to(folder) if flights.is_relative_to(folder) else False
        if is_default and not flights.exists():
            flights.mkdir()
        return ""
    if not Path(os.path.realpath(flights)).is_relative_to(os.path.realpath(folder)):
        reason = f"is where flights_dir has the logs, outside of {folder.resolve()}, and no links are put there"
        raise UserError(flights, reason, "Leave the logs out of the command, or set flights_dir: flights")
    from fusetune.apply.wording import counted
    from fusetune.save.linked_logs import link_logs

    linked = link_logs(options.logs, flights)
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


def _link_results(folder: Path, results: Path) -> None:
    own, target = folder / RESULTS, Path(os.path.abspath(results))
    if own.is_symlink() and os.path.realpath(own) == os.path.realpath(target):
        target.mkdir(parents=True, exist_ok=True)
        return
    if own.is_symlink() or own.exists():
        if os.path.realpath(own) == os.path.realpath(target):
            return
        raise UserError(own, "is there already", f"Move it to {results}, or leave out --results")
    target.mkdir(parents=True, exist_ok=True)
    try:
        own.symlink_to(target, target_is_directory=True)
    except (OSError, NotImplementedError) as error:
        raise UserError(own, f"cannot be a link to {results} ({error})", "Leave out --results") from error


def _decision_bytes(folder: Path) -> bytes:
    try:
        return (folder / RESULTS / "apply" / "decision.json").read_bytes()
    except OSError:
        return b""


def _tell_end(folder: Path, as_json: bool, *, is_same: bool) -> None:
    """The decision, the files, the next step."""
    results = folder / RESULTS
    rows = _flights(results)
    decision = results / "apply" / "decision.json"
    document: dict[str, Any] = {
        "flights": len(rows),
        "refused": sum(status != "replayable" for status in rows.values()),
        # the demonstration's logs are made there
        "simulated": bool(rows) and all((results / "execute" / f"{flight}.ulg").is_file() for flight in rows),
    }
    if decision.is_file():
        from fusetune.apply.decision_summary import decision_summary
        from fusetune.storage.documents import read_document

        summary = decision_summary(read_document(decision))
        files = {"report": results / "report.html", "parameters": results / "apply" / "best_params.params"}
        document |= {**summary.document(), "files": files, "is_as_before": is_same}
    if as_json:
        print_document(document)
        return
    from fusetune.cli.lines import Lines

    lines = Lines()
    for line in _last_lines(document, results):
        lines.tell_below(line)


def _flights(results: Path) -> dict[str, str]:
    """Every log's verdict."""
    from fusetune.storage.parquet import read_table

    table = results / "save" / "flights.parquet"
    rows = read_table(table).select(["flight", "status"]).to_pylist() if table.is_file() else []
    return {row["flight"]: row["status"] for row in rows}


def _last_lines(document: dict[str, Any], results: Path) -> list[str]:
    from fusetune.apply.wording import counted

    kind = "simulated flight" if document["simulated"] else "flight"
    lines = [f"{counted(document['flights'], kind)}, {document['refused']} refused"]
    if document["refused"]:
        lines[0] += f" (why: {results / 'save' / 'flights.csv'})"
    if "decision" not in document:
        return lines
    lines.append(document["sentence"])
    for one in document["parameters"]:
        lines.append(f"  {one['name']}  {one['previous']:.6g} → {one['value']:.6g}")
    if document["can_be_loaded"]:
        lines.append(f"To load: {document['files']['parameters']}")
    lines.append(f"Why:     {document['files']['report']}")
    if document["next_step"]:
        lines.append(f"Next:    {document['next_step']}")
    return lines
