"""`fusetune search`."""

from __future__ import annotations

import argparse
from pathlib import Path

from fusetune.cli.command import DONE

HELP = "find the parameters that predict the flights of some logs best"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Logs, the folder that takes all, and how to search."""
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG.ulg")
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="takes best_params.params, search.json and what is kept for going on: a search that was stopped goes on",
    )
    parser.add_argument(
        "--parameters", type=Path, metavar="FILE", help="YAML file of what to search, and how (docs/search.md)"
    )
    parser.add_argument("--evaluations", type=int, metavar="N", help="parameter sets that are tried (400)")
    parser.add_argument("--seed", type=int, metavar="N", help="what chance follows from (1)")
    parser.add_argument("--cores", type=int, metavar="N", help="processes that replay (all cores)")


def run(options: argparse.Namespace) -> int:
    """Search, and tell what was found; always `DONE`."""
    import os

    from fusetune.apply.search.log_search import search_logs
    from fusetune.design.search_settings import SearchSettings
    from fusetune.settings.checking import checked
    from fusetune.settings.yaml_reader import read_yaml

    document = dict(read_yaml(options.parameters)) if options.parameters else {}
    document |= {name: value for name in ("evaluations", "seed") if (value := getattr(options, name)) is not None}
    settings = checked(SearchSettings, document, options.parameters or "the command line")
    processes = options.cores or os.cpu_count() or 1
    found = search_logs(options.logs, options.out, settings, processes=processes, told=_told)
    print(
        "", *found["paragraphs"], f"Written: {options.out / 'best_params.params'} and what led to it beside.", sep="\n"
    )
    return DONE


def _told(line: str) -> None:
    print(line, flush=True)
