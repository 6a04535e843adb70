"""`fusetune replay`."""

from __future__ import annotations

import argparse
from pathlib import Path

from fusetune.cli.command import DONE

HELP = "replay parameter sets on a log"
EXAMPLES = (("fusetune replay log.ulg --sets sets --out replays --start auto", "every set of the folder sets"),)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Log, sets, folder, and how it is replayed."""
    parser.add_argument("log", type=Path, metavar="LOG.ulg")
    parser.add_argument(
        "--sets",
        type=Path,
        required=True,
        metavar="DIR",
        help='folder with one SET.json per set: {"params": {NAME: value}, "overrides": {NAME: value}}',
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument(
        "--reconstruct", action="store_true", help="give the filter back what the logger left out (docs/any_log.md)"
    )
    parser.add_argument(
        "--start",
        choices=("auto", "warm", "cold"),
        default="cold",
        help="from the vehicle's own logged state (warm), from nothing (cold, the default), or what suits the log",
    )
    parser.add_argument(
        "--release",
        default="v1.16",
        metavar="RELEASE",
        help="release of PX4 whose estimator replays it: v1.16 (the default), v1.17 or main (docs/releases.md)",
    )


def run(options: argparse.Namespace) -> int:
    """Replay all and name them; always `DONE`."""
    from fusetune.analyze.reconstruction import ReconstructionSettings
    from fusetune.analyze.replaying.replay_log import replay_log
    from fusetune.analyze.replaying.settings import ReplaySettings, StartSettings

    reconstruction = ReconstructionSettings() if options.reconstruct else None
    settings = ReplaySettings(reconstruction=reconstruction, start=StartSettings(mode=options.start))
    print("replayed:", *replay_log(options.log, options.sets, options.out, settings, options.release))
    return DONE
