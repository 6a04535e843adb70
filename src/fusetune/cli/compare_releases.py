"""`fusetune compare-releases`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fusetune.cli.command import DONE
from fusetune.cli.output.json_document import add_json, print_document
from fusetune.cli.output.tables import percent, table_lines

if TYPE_CHECKING:
    from fusetune.analyze.releases.compared_releases import ReleaseComparison, ReleaseReplay

HELP = "replay a flight by the EKF2 of several releases of PX4: what would an update change?"
EXAMPLES = (
    ("fusetune compare-releases flight.ulg", "all releases that are modelled"),
    ("fusetune compare-releases flight.ulg --releases v1.16,v1.17 --figure releases.svg", "two, as a figure, too"),
)
_NOTHING = "–"
_ALL_BUT_NEVER = 0.9995


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Log, releases, and how to tell."""
    from fusetune.px4.releases import ESTIMATORS

    parser.add_argument("log", type=Path, metavar="LOG.ulg")
    parser.add_argument(
        "--releases",
        type=_names,
        default=(),
        metavar="NAME,…",
        help=f"of {', '.join(ESTIMATORS)} (all that are modelled)",
    )
    parser.add_argument(
        "--keep-parameters",
        action="store_true",
        help="keep every parameter as it flew; by default those at their default follow the new release's",
    )
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw it, too: .svg, .pdf or .png")
    add_json(parser)
    parser.epilog = (
        "The parameters are those that an update would leave, in the names of each release; the samples are those that "
        "the release that flew took. Figures are of the time in the air."
    )


def run(options: argparse.Namespace) -> int:
    """Replay, and print the table or the document; always `DONE`."""
    from fusetune.analyze.observed.observed_flight import ObservedFlight
    from fusetune.analyze.releases.compared_releases import compare_releases
    from fusetune.analyze.replaying.settings import WITHOUT_GAPS
    from fusetune.ekf2.releases.behaviours import MODELLED
    from fusetune.px4.ulog.reader import read_ulog

    observed = ObservedFlight(read_ulog(options.log), WITHOUT_GAPS)
    observed.verdict.demand_replayable(options.log)
    found = compare_releases(
        observed.prepared,
        options.releases or MODELLED,
        keep_parameters=options.keep_parameters,
        tell=lambda release: print(f"{release} …", file=sys.stderr),
    )
    if options.figure is not None:
        from fusetune.report.figures.publication import publication_style, save_figure
        from fusetune.report.figures.release_figure import draw_releases

        with publication_style():
            save_figure(draw_releases(found), options.figure)
    if options.json:
        print_document(found)
        return DONE
    from fusetune.cli.lines import Lines

    lines = Lines()
    for line in _lines(found):
        lines.tell(line)
    return DONE


def _names(text: str) -> tuple[str, ...]:
    from fusetune.px4.releases import ESTIMATORS

    names = tuple(one.strip() for one in text.split(",") if one.strip())
    unknown = [one for one in names if one not in ESTIMATORS]
    if unknown or not names:
        raise argparse.ArgumentTypeError(f"{', '.join(unknown) or 'nothing'} is none of {', '.join(ESTIMATORS)}")
    return names


def _lines(found: ReleaseComparison) -> Iterator[str]:
    yield f"{found.flight}: {found.flown} flew ({found.evidence}); {found.compared_s:.0f} s in the air are compared"
    yield ""
    rows = [("", *(one.release for one in found.replays)), *_innovation_rows(found), *_event_rows(found)]
    yield from table_lines(rows, right=range(1, len(found.replays) + 1))
    yield ""
    yield f"In brackets: the RMS of the innovations against {found.base}'s."
    for one in found.replays:
        yield from _about(one, found.base)


def _innovation_rows(found: ReleaseComparison) -> Iterator[Sequence[str]]:
    from fusetune.px4.aid_sources import AID_SOURCES, AXES

    for source, axis in found.keys:
        about = AID_SOURCES[source]
        name = source if about.axes == 1 else f"{source} {AXES[axis]}"
        yield (f"{name}, {about.unit}" if about.unit else name, *(_cell(one, source, axis) for one in found.replays))


def _cell(replay: ReleaseReplay, source: str, axis: int) -> str:
    one = replay.axis(source, axis)
    if one is None:
        return _NOTHING
    return f"{one.rms:.3g}" + ("" if one.rms_change is None else f" ({percent(100.0 * one.rms_change)})")


def _event_rows(found: ReleaseComparison) -> Iterator[Sequence[str]]:
    yield ("rejected samples", *(str(one.rejected) for one in found.replays))
    for kind in dict.fromkeys(kind for one in found.replays for kind in one.events.resets):
        counts = [one.events.resets.get(kind, 0) for one in found.replays]
        if any(counts):
            yield (f"resets of {kind.replace('_', ' ')}", *map(str, counts))
    yield ("sources lost", *(str(one.events.total_timeouts) for one in found.replays))
    yield ("without horizontal aiding, s", *(f"{one.events.dead_reckoning_s:.1f}" for one in found.replays))


def _about(replay: ReleaseReplay, base: str) -> Iterator[str]:
    """What else is to be said of one release: that it did not run, flags, faults, parameters."""
    if replay.status != "ok":
        yield f"{replay.release} {replay.status.replace('_', ' ')}: {replay.reason}"
    if replay.events.faults:
        yield f"{replay.release} had faults: {', '.join(replay.events.faults)}"
    differing = sorted((one for one in replay.flags if one.equal < _ALL_BUT_NEVER), key=lambda one: one.equal)
    if differing:
        told = ", ".join(f"{one.flag} {1.0 - one.equal:.1%}" for one in differing[:6])
        yield f"{replay.release} has flags otherwise than {base}, share of the time: {told}"
    changes = [
        f"{name} {value:g} (new)" if before is None else f"{name} {before:g} → {value:g}"
        for name, (before, value) in sorted(replay.parameters.items())
        if before is not None or value
    ]
    if changes:
        more = f" and {len(changes) - 8} more" if len(changes) > 8 else ""
        yield f"{replay.release} would have {', '.join(changes[:8])}{more}"
