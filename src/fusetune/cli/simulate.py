"""`fusetune simulate`."""

from __future__ import annotations

import argparse
import datetime
from dataclasses import replace
from pathlib import Path

from fusetune.cli.command import DONE
from fusetune.errors import UserError

HELP = "fly a mission with a simulated vehicle and write its log"
EXAMPLES = (
    (
        "fusetune simulate --mission survey.plan --vehicle config/vehicles/quadrotor.yaml --out flight.ulg",
        "a log of a simulated flight",
    ),
)

LARGEST_SEED = 2**53


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Mission, vehicle, the set that flies, faults, seed, log."""
    parser.add_argument("--mission", type=Path, required=True, metavar="MISSION")
    parser.add_argument("--vehicle", type=Path, required=True, metavar="VEHICLE.yaml")
    parser.add_argument("--study", type=Path, metavar="STUDY.yaml", help="study that holds the set to fly")
    parser.add_argument(
        "--set", metavar="NAME", help="set of the study to fly; without it the vehicle's own parameters"
    )
    parser.add_argument(
        "--parameters",
        type=Path,
        metavar="FILE.params",
        help="parameter file that the vehicle has loaded (.params or .parm)",
    )
    parser.add_argument("--date", type=_date, metavar="YYYY-MM-DD", help="day of the flight; else that of the vehicle")
    parser.add_argument("--faults", type=Path, metavar="FILE.yaml", help="YAML file with a list `faults`")
    parser.add_argument("--seed", type=_seed, default=1, metavar="NUMBER", help="whole number from 0 (1)")
    parser.add_argument("--out", type=Path, required=True, metavar="LOG.ulg")


def run(options: argparse.Namespace) -> int:
    """Fly and tell for how long; always `DONE`."""
    from fusetune.design.missions.mission import load_mission
    from fusetune.execute import simulate
    from fusetune.execute.sensors.faults import load_faults
    from fusetune.execute.vehicle import load_vehicle

    vehicle = load_vehicle(options.vehicle)
    if options.date is not None:
        vehicle = replace(vehicle, environment=replace(vehicle.environment, date=options.date))
    loaded = _loaded(options.parameters) if options.parameters is not None else {}
    flight = simulate(
        load_mission(options.mission),
        vehicle,
        {**loaded, **_flown_set(options.study, options.set)},
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


def _date(text: str) -> datetime.date:
    """A day of the calendar."""
    try:
        return datetime.date.fromisoformat(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no day, as 2025-06-15 is") from None


def _loaded(file: Path) -> dict[str, float]:
    """Parameters of the estimator that a file sets; the simulated vehicle has no others."""
    from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, ParameterError, check_value
    from fusetune.px4.parameters.line_files import read_parameter_file

    entries = read_parameter_file(file)
    found: dict[str, float] = {}
    for entry in entries:
        if entry.name in PARAMETERS:
            try:
                check_value(entry.name, entry.value)
            except ParameterError as error:
                raise UserError(file, f"{error.name}: {error.reason}", error.remedy) from error
            found[entry.name] = entry.value
    if len(found) < len(entries):
        print(f"{file}: {len(entries) - len(found)} parameters are none of the estimator's and are left out")
    return found


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
