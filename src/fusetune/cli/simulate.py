"""`fusetune simulate`."""

from __future__ import annotations

import argparse
from pathlib import Path

from fusetune.cli.command import DONE
from fusetune.errors import UserError

HELP = "fly a mission with a simulated vehicle and write its log"

LARGEST_SEED = 2**53


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Mission, vehicle, the set that flies, faults, seed, log."""
    parser.add_argument("--mission", type=Path, required=True, metavar="FILE")
    parser.add_argument("--vehicle", type=Path, required=True, metavar="FILE")
    parser.add_argument("--study", type=Path, metavar="FILE", help="study that holds the set to fly")
    parser.add_argument(
        "--set", metavar="NAME", help="set of the study to fly; without it the vehicle's own parameters"
    )
    parser.add_argument("--faults", type=Path, metavar="FILE", help="YAML file with a list `faults`")
    parser.add_argument("--seed", type=_seed, default=1, metavar="NUMBER", help="whole number from 0 (1)")
    parser.add_argument("--out", type=Path, required=True, metavar="LOG.ulg")


def run(options: argparse.Namespace) -> int:
    """Fly and tell for how long; always `DONE`."""
    from fusetune.design.missions.mission import load_mission
    from fusetune.execute import simulate
    from fusetune.execute.sensors.faults import load_faults
    from fusetune.execute.vehicle import load_vehicle

    flight = simulate(
        load_mission(options.mission),
        load_vehicle(options.vehicle),
        _flown_set(options.study, options.set),
        options.seed,
        load_faults(options.faults) if options.faults else (),
        options.out,
    )
    print(f"{options.out}: {flight.duration_s:.1f} s")
    return DONE


def _seed(text: str) -> int:
    """A seed, as the configuration takes it."""
    if not text.isascii() or not text.isdigit() or int(text) > LARGEST_SEED:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number from 0 to {LARGEST_SEED}")
    return int(text)


def _flown_set(study_file: Path | None, name: str | None) -> dict[str, float]:
    if study_file is None and name is None:
        return {}
    if study_file is None or name is None:
        raise UserError("command line", "--study and --set belong together", "Give both or neither")
    from fusetune.design.study import load_study

    study = load_study(study_file)
    try:
        return study.set_named(name).overrides
    except KeyError:
        names = ", ".join(pset.name for pset in study.sets)
        raise UserError(study_file, f"has no set {name!r}", f"Choose one of {names}") from None
