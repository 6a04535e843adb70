"""The command `fusetune`: single steps of the pipeline on single files.

Each sub-command loads only the rooms it needs. Its exit status:

0    all is done
1    all that could be done is: at least one log was refused, and the lines printed say why and what to do about it
2    nothing more could be done, because of the command line or a file: one line says what to do
130  interrupted (Ctrl-C)
141  who read the output has gone
"""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fusetune import __version__
from fusetune.errors import UserError

if TYPE_CHECKING:
    from fusetune.analyze.trust.fidelity import ReplayFidelity
    from fusetune.finding import Finding

    Commands = argparse._SubParsersAction[argparse.ArgumentParser]

DONE_STATUS = 0
REFUSED_STATUS = 1
USER_ERROR_STATUS = 2
INTERRUPTED_STATUS = 130
NO_READER_STATUS = 141

LARGEST_SEED = 2**53


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command; returns the exit status."""
    # read when NumPy is first imported; the matrices are too small for threads, which would only cost time
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    _print_any_name()
    options = _parser().parse_args(arguments)
    try:
        status: int = options.run(options)
        if sys.stdout is not None:
            sys.stdout.flush()
    except UserError as error:
        return _failed(str(error))
    except KeyboardInterrupt:
        print("fusetune: interrupted", file=sys.stderr)
        return INTERRUPTED_STATUS
    except BrokenPipeError:
        # else Python tries once more to write what is left, and complains
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return NO_READER_STATUS
    except OSError as error:
        return _failed(f"{error.filename or 'the output'}: {error.strerror or error}. Mend the path or make room.")
    return status


def _print_any_name() -> None:
    """Let names of files that the terminal cannot show be printed as escapes instead of ending the command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _failed(message: str) -> int:
    print(f"fusetune: {message}", file=sys.stderr)
    return USER_ERROR_STATUS


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fusetune",
        description="Single steps of the pipeline; `snakemake` runs them all.",
        epilog="Exit status: 0 all is done; 1 a log was refused; 2 the command or a file cannot be used.",
    )
    parser.add_argument("--version", action="version", version=f"fusetune {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    _add_design(commands)
    _add_simulate(commands)
    _add_save(commands)
    _add_replay(commands)
    _add_fidelity(commands)
    return parser


def _add_design(commands: Commands) -> None:
    parser = commands.add_parser("design", help="write a mission plan and the parameter files of a study")
    parser.add_argument("--mission", type=Path, required=True, metavar="FILE")
    parser.add_argument("--study", type=Path, required=True, metavar="FILE")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.set_defaults(run=_design)


def _design(options: argparse.Namespace) -> int:
    from fusetune.design import write_design

    write_design(options.mission, options.study, options.out)
    return DONE_STATUS


def _add_simulate(commands: Commands) -> None:
    parser = commands.add_parser("simulate", help="fly a mission with a simulated vehicle and write its log")
    parser.add_argument("--mission", type=Path, required=True, metavar="FILE")
    parser.add_argument("--vehicle", type=Path, required=True, metavar="FILE")
    parser.add_argument("--study", type=Path, metavar="FILE", help="study that holds the set to fly")
    parser.add_argument(
        "--set", metavar="NAME", help="set of the study to fly; without it the vehicle's own parameters"
    )
    parser.add_argument("--faults", type=Path, metavar="FILE", help="YAML file with a list `faults`")
    parser.add_argument("--seed", type=_seed, default=1, metavar="NUMBER", help="whole number from 0 (1)")
    parser.add_argument("--out", type=Path, required=True, metavar="LOG.ulg")
    parser.set_defaults(run=_simulate)


def _seed(text: str) -> int:
    """A seed, as the configuration takes it."""
    if not text.isascii() or not text.isdigit() or int(text) > LARGEST_SEED:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number from 0 to {LARGEST_SEED}")
    return int(text)


def _simulate(options: argparse.Namespace) -> int:
    from fusetune.design.mission import load_mission
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
    return DONE_STATUS


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


def _add_save(commands: Commands) -> None:
    parser = commands.add_parser("save", help="turn logs into folders of tables, each with a verdict")
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG.ulg")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="takes one folder per log")
    parser.set_defaults(run=_save)


def _save(options: argparse.Namespace) -> int:
    from fusetune.save import save_log

    _check_names(options.logs)
    verdicts = []
    for log in options.logs:
        verdict = save_log(log, options.out / log.stem)
        print(f"{log.stem}: {verdict.status}", *map(_advice, verdict.failures), sep="\n  ")
        verdicts.append(verdict)
    return DONE_STATUS if all(verdict.status == "replayable" for verdict in verdicts) else REFUSED_STATUS


def _check_names(logs: Sequence[Path]) -> None:
    """Each log gets a folder by its name."""
    first: dict[str, Path] = {}
    for log in logs:
        if log.stem in ("", ".", ".."):
            raise UserError(log, "gives no name to a folder", "Rename it")
        other = first.setdefault(log.stem.casefold(), log)
        if other is not log:
            raise UserError(log, f"would be saved into the same folder as {other}", "Rename one, or save it elsewhere")


def _advice(finding: Finding) -> str:
    """What is wrong, and what to do about it."""
    return f"{finding.found}. {finding.remedy}."


def _add_replay(commands: Commands) -> None:
    parser = commands.add_parser("replay", help="replay parameter sets on a log")
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
    parser.set_defaults(run=_replay)


def _replay(options: argparse.Namespace) -> int:
    from fusetune.analyze.reconstruction import ReconstructionSettings
    from fusetune.analyze.replaying.replay_log import replay_log
    from fusetune.analyze.replaying.settings import ReplaySettings, StartSettings

    reconstruction = ReconstructionSettings() if options.reconstruct else None
    settings = ReplaySettings(reconstruction=reconstruction, start=StartSettings(mode=options.start))
    print("replayed:", *replay_log(options.log, options.sets, options.out, settings))
    return DONE_STATUS


def _add_fidelity(commands: Commands) -> None:
    parser = commands.add_parser("fidelity", help="compare replays with reference replays of the same flight")
    parser.add_argument("reference", type=Path, metavar="REFERENCE_DIR")
    parser.add_argument("replay", type=Path, metavar="REPLAY_DIR")
    parser.set_defaults(run=_fidelity)


def _fidelity(options: argparse.Namespace) -> int:
    from fusetune.analyze.trust.fidelity import compare_folders, order_agreement

    results = compare_folders(options.reference, options.replay)
    for result in results:
        _print_fidelity(result)
    if len(results) > 2:
        print(f"order of the sets by NLL, Kendall tau: {order_agreement(results):.2f}")
    return DONE_STATUS


def _print_fidelity(result: ReplayFidelity) -> None:
    print(f"{result.set}")
    print(
        f"  {'source':<16}{'samples':>8}{'RMS diff.':>11}{'variance':>11}{'fused =':>10}{'rejected =':>11}{'NLL':>10}"
    )
    for axis in result.axes:
        print(
            f"  {f'{axis.source}[{axis.axis}]':<16}{axis.samples:>8}{axis.relative_rms:>11.3%}"
            f"{axis.variance_difference:>11.3%}{axis.fused_equal:>11.3%}{axis.rejected_equal:>11.3%}"
            f"{axis.nll_difference:>+11.4f}"
        )
    print(
        f"  flags equal {result.flags_equal:.2%} of the time; resets {'equal' if result.resets_equal else 'differ'}; "
        f"samples without partner {result.missing:.2%}"
    )
    print(
        f"  RMS difference: velocity {result.velocity_rms:.4f} m/s, attitude {result.attitude_rms_deg:.4f} deg, "
        f"gyro bias {result.gyro_bias_rms:.2e} rad/s"
    )


if __name__ == "__main__":
    sys.exit(main())
