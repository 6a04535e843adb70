"""`fusetune search`."""

from __future__ import annotations

import argparse
from pathlib import Path

from fusetune.cli.command import DONE
from fusetune.cli.output.json_document import add_json, print_document
from fusetune.cli.output.numbers import from_one

HELP = "find the parameters that predict the flights of some logs best"
EXAMPLES = (
    ("fusetune search flights/*.ulg --out found", "600 sets over what the flights exercise"),
    ("fusetune search flights/*.ulg --out found --evaluations 250 --cores 4", "sooner, with less"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Logs, the folder that takes all, and how to search."""
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG.ulg")
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="new folder, or one of a search that was stopped, which goes on; takes best_params.params, search.html, "
        "search.json and what is kept for going on",
    )
    parser.add_argument(
        "--parameters", type=Path, metavar="FILE.yaml", help="YAML file of what to search, and how (docs/search.md)"
    )
    parser.add_argument("--evaluations", type=int, metavar="N", help="parameter sets that are tried (600)")
    parser.add_argument("--seed", type=int, metavar="N", help="what chance follows from (1)")
    parser.add_argument("--cores", type=from_one, metavar="N", help="processes that replay (all cores)")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Search, and tell what was found; always `DONE`."""
    import sys

    from fusetune.apply.search.answer import answer_lines
    from fusetune.apply.search.log_search import search_logs
    from fusetune.cli.lines import Lines
    from fusetune.design.search_settings import SearchSettings
    from fusetune.report.search_page import build_search_page
    from fusetune.report.search_results import read_search
    from fusetune.running.worker_processes import all_cores
    from fusetune.settings.checking import checked
    from fusetune.settings.yaml_reader import read_yaml

    document = dict(read_yaml(options.parameters)) if options.parameters else {}
    document |= {name: value for name in ("evaluations", "seed") if (value := getattr(options, name)) is not None}
    asked_in = options.parameters or "the command line"
    settings = checked(SearchSettings, document, asked_in)
    processes = options.cores or all_cores()
    lines = Lines(sys.stderr if options.json else sys.stdout)
    try:
        search_logs(options.logs, options.out, settings, processes=processes, told=lines.tell, asked_in=asked_in)
    finally:
        lines.end()
    page = build_search_page(options.out)
    results = read_search(options.out)
    if options.json:
        # what each flight and each search had is in the file
        told = {name: value for name, value in results.search.items() if name not in ("paragraphs", "searches")}
        print_document({**told, "next_steps": results.decision["next_steps"], "page": page, "folder": options.out})
        return DONE
    lines.tell("")
    for one in answer_lines(results.search, results.decision, results.sensitivity.sentences):
        lines.tell(one)
    lines.tell(f"To load: {options.out / 'best_params.params'}. To look at: {page}.")
    return DONE
