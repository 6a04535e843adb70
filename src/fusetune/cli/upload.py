"""`fusetune upload`."""

from __future__ import annotations

import argparse
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from fusetune.cli.command import DONE, REFUSED

if TYPE_CHECKING:
    from fusetune.apply.upload.uploading import Upload

HELP = "write the decided parameters to the vehicle, verified, or take them back"
EXAMPLES = (
    ("fusetune upload --to udp:14550", "what results/apply/best_params.params changes, asked for first"),
    ("fusetune upload --to /dev/ttyACM0 --rollback results/apply/rollback.params", "take it back"),
)
TAKEN_BACK = 3
"""Exit status where it did not work and what was written is taken back; `REFUSED` where nothing was written."""
UNFINISHED = 4
"""Exit status where it is not known of all values which stand: `--resume` goes on."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """File, vehicle, and what to do."""
    parser.add_argument(
        "file",
        type=Path,
        nargs="?",
        default=Path("results/apply/best_params.params"),
        metavar="BEST_PARAMS",
        help="with its decision.json beside it (results/apply/best_params.params)",
    )
    parser.add_argument(
        "--to",
        required=True,
        metavar="VEHICLE",
        help="udp:14550 waits for it there; udp:host:port, tcp:host:port; /dev/ttyACM0 or COM3, with ,baud",
    )
    parser.add_argument("--system", type=_system, metavar="ID", help="MAVLink id of the vehicle where several answer")
    parser.add_argument("--yes", action="store_true", help="write without being asked, as in scripts")
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--rollback", type=Path, metavar="BACKUP", help="write what a backup.params or rollback.params holds instead"
    )
    what.add_argument("--resume", action="store_true", help="go on with an upload that was not finished")
    parser.add_argument(
        "--folder",
        type=Path,
        metavar="DIR",
        help="takes backup, journal and transcript, in a new folder in it (uploads); of --resume the upload's own",
    )
    parser.add_argument(
        "--patience", type=_seconds, default=120.0, metavar="S", help="how long a lost vehicle is waited for (120)"
    )


def run(options: argparse.Namespace) -> int:
    """Upload; `DONE`, `REFUSED`, `TAKEN_BACK` or `UNFINISHED`."""
    from fusetune.apply.upload.needs import require_pymavlink

    require_pymavlink()
    from fusetune.apply.upload.stops import Refusal
    from fusetune.apply.upload.uploading import Outcome

    statuses = {
        Outcome.WRITTEN: DONE,
        Outcome.NOTHING: DONE,
        Outcome.TAKEN_BACK: TAKEN_BACK,
        Outcome.UNFINISHED: UNFINISHED,
    }
    upload = _upload(options)
    try:
        if options.resume:
            return statuses[upload.resume(options.folder)]
        return statuses[upload.rollback(options.rollback) if options.rollback else upload.new(options.file)]
    except Refusal as refusal:
        print(f"fusetune: refused: {refusal}", file=sys.stderr)
        return UNFINISHED if options.resume else REFUSED


def _upload(options: argparse.Namespace) -> Upload:
    from dataclasses import replace

    from fusetune.apply.upload.pace import Pace
    from fusetune.apply.upload.transcript import Transcript
    from fusetune.apply.upload.uploading import Asked, Upload
    from fusetune.cli.lines import Lines

    folder = options.folder if options.folder and not options.resume else Path("uploads")
    pace = replace(Pace(), patience_s=options.patience)
    ask = _yes if options.yes else _ask_terminal
    return Upload(Asked(options.to, folder, ask, Transcript(Lines().tell), options.system, pace))


def _yes(question: str, meanwhile: Callable[[], None]) -> bool:
    return True


def _ask_terminal(question: str, meanwhile: Callable[[], None]) -> bool:
    """Ask, and do something until the answer is there; nobody to ask is a no."""
    if not sys.stdin.isatty():
        from fusetune.apply.upload.stops import Refusal

        raise Refusal("there is no terminal to ask at; nothing was written", "Give --yes if you mean it")
    print(f"{question} Type yes: ", end="", flush=True)
    answers: list[str] = []
    reader = threading.Thread(target=lambda: answers.append(sys.stdin.readline()), daemon=True)
    reader.start()
    while reader.is_alive():
        meanwhile()
    return bool(answers) and answers[0].strip().casefold() == "yes"


def _system(text: str) -> int:
    """A MAVLink system id."""
    if not text.isascii() or not text.isdigit() or not 0 < int(text) < 256:
        raise argparse.ArgumentTypeError(f"{text!r} is no system id from 1 to 255")
    return int(text)


def _seconds(text: str) -> float:
    """A time that ends."""
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0.0 <= seconds <= 86400.0:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of seconds up to a day")
    return seconds
