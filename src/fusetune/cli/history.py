"""`fusetune history`."""

from __future__ import annotations

import argparse
from pathlib import Path

from fusetune.cli.command import DONE
from fusetune.cli.output.json_document import add_json, print_document
from fusetune.errors import UserError

HELP = "tell what was decided for a vehicle, when, and what it brought"
EXAMPLES = (
    ("fusetune history", "all vehicles"),
    ("fusetune history PX4_FMU_V6X --json", "one of them, for a script"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Vehicle, folder, and where to export to."""
    parser.add_argument(
        "vehicle", nargs="?", metavar="VEHICLE", help="name or id, or how either begins; without it all vehicles"
    )
    parser.add_argument("--folder", type=Path, default=Path("results/history"), metavar="DIR")
    add_json(parser)
    parser.add_argument(
        "--mlflow", type=Path, metavar="DIR", help="export studies, sets and figures to an MLflow store in this folder"
    )


def run(options: argparse.Namespace) -> int:
    """Print the histories, or export them; always `DONE`."""
    from fusetune.apply.history.entries import SUFFIX, read_history
    from fusetune.apply.history.words import history_lines
    from fusetune.apply.wording import counted

    files = sorted(options.folder.glob(f"*{SUFFIX}")) if options.folder.is_dir() else []
    kept = [(file, history) for file in files if (history := read_history(file)).decisions]
    if options.vehicle is not None:
        kept = [one for one in kept if one[1].decisions[-1].vehicle.is_called(options.vehicle)]
    if not kept:
        what = "no history" if options.vehicle is None else f"no history of {options.vehicle!r}"
        raise UserError(
            options.folder, f"holds {what}", "Run the pipeline, which keeps every decision, or name another"
        )
    if options.mlflow is not None:
        from fusetune.apply.history.mlflow_export import export_histories

        runs = export_histories([history for _, history in kept], options.mlflow)
        print(f"{options.mlflow}: {counted(runs, 'run')} added. Look at them: {_look(options.mlflow)}")
        return DONE
    if options.json:
        print_document(
            [
                {"file": file, "vehicle": history.decisions[-1].vehicle.in_words, "decisions": history.decisions}
                | {"outcomes": history.outcomes}
                for file, history in kept
            ]
        )
        return DONE
    for file, history in kept:
        changes = sum(one.is_change for one in history.decisions)
        told = f"{counted(len(history.decisions), 'decision')}, {counted(changes, 'change')}"
        print(f"{history.decisions[-1].vehicle.in_words}: {told} ({file})")
        for line in history_lines(history):
            print(f"  {line}")
    return DONE


def _look(folder: Path) -> str:
    from fusetune.apply.history.mlflow_export import store_of

    return f"mlflow ui --backend-store-uri {store_of(folder)}"
