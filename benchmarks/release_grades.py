"""Trust grades of logs replayed by v1.16 and by the release that flew: the table of docs/releases.md.

    python -m benchmarks.release_grades LOGS_DIR                       # prints the table
    python -m benchmarks.release_grades LOGS_DIR docs/releases.md      # puts it there
    python -m benchmarks.release_grades LOGS_DIR --start warm          # started from the vehicle's own state

LOGS_DIR holds ULog files. Those that can be replayed are repaired and started as the pipeline does it, once with
v1.16's estimator and once with that of `release: auto`; the figures are those of docs/any_log.md, v1.16 → own.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.decision_study.tables import between_marks

from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.analyze.replaying.prepared_flight import prepare_flight
from fusetune.analyze.replaying.settings import WITHOUT_GAPS, StartSettings
from fusetune.analyze.trust.as_flown_comparison import AsFlownComparison, distance
from fusetune.analyze.trust.as_flown_figures import AsFlownFigures
from fusetune.analyze.trust.grade import grade_of
from fusetune.analyze.trust.settings import TrustSettings
from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache
from fusetune.ekf2.releases.behaviours import BASELINE
from fusetune.errors import UserError
from fusetune.px4.releases import AUTO
from fusetune.px4.ulog.reader import read_ulog

TABLE = "grades"
HEADER = (
    "log", "flew", "replayed by", "start", "grade", "distance", "innovations", "velocity, m/s", "heading, °",
    "height, m", "vertical velocity, m/s", "flags alike", "height alike", "resets",
)  # fmt: skip
FIGURES: tuple[tuple[str, str], ...] = (
    ("innovation_factor", ".2f"),
    ("velocity_m_s", ".3f"),
    ("heading_deg", ".2f"),
    ("height_m", ".2f"),
    ("vertical_velocity_m_s", ".3f"),
    ("flags_equal", ".3f"),
    ("height_flags_equal", ".3f"),
    ("height_resets", ".0f"),
)
"""Of `AsFlownFigures`, and how they are written."""


@dataclass(frozen=True)
class GradedReplay:
    """What the replay of one release's estimator is worth on a log.

    Attributes
    ----------
    grade : A to D, by the limits of the default configuration
    distance : mean of the figures, each as a share of its limit of grade B
    """

    release: str
    grade: str
    distance: float
    figures: AsFlownFigures
    start: str


def graded(log: Path, releases: Sequence[str], start: StartSettings) -> tuple[str, list[GradedReplay]] | str:
    """The release that flew, and the replays of a log by some releases; what speaks against replaying it."""
    observed = ObservedFlight(read_ulog(log), WITHOUT_GAPS)
    if observed.verdict.status == "refused":
        return "; ".join(observed.verdict.reasons)
    settings, found = TrustSettings(causes=False), []
    for release in releases:
        prepared = prepare_flight(observed.flight, replace(WITHOUT_GAPS, release=release, start=start))
        figures = AsFlownComparison(prepared.flight, settings).figures(prepared)
        grade, apart = grade_of(figures, settings).grade, distance(figures, settings)
        found.append(GradedReplay(prepared.release, grade, apart, figures, prepared.start.mode))
    return observed.flight.release_name, found


def rows(logs: Sequence[Path], start: StartSettings, count: Callable[[str, str], None]) -> Iterator[tuple[str, ...]]:
    """A line of the table for each log."""
    for log in logs:
        try:
            answer = graded(log, (BASELINE, AUTO), start)
        except UserError as error:
            answer = error.reason
        if isinstance(answer, str):
            yield (log.stem, f"not replayed: {answer.partition(':')[0]}", *["–"] * (len(HEADER) - 2))
            continue
        flew, (before, after) = answer
        if math.isnan(after.distance):
            told = (log.stem, flew, after.release, after.start, "– (nothing to compare)")
            yield (*told, *["–"] * (len(HEADER) - len(told)))
            continue
        count(before.grade, after.grade)
        yield (
            log.stem, flew, after.release, after.start, _both(before.grade, after.grade),
            _both(f"{before.distance:.2f}", f"{after.distance:.2f}"),
            *(
                _both(*(_number(getattr(one.figures, name), form) for one in (before, after)))
                for name, form in FIGURES
            ),
        )  # fmt: skip


def _number(value: float | None, form: str) -> str:
    return "–" if value is None else format(value, form)


def _both(before: str, after: str) -> str:
    return before if before == after else f"{before} → {after}"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.release_grades",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("logs", type=Path)
    parser.add_argument("document", type=Path, nargs="?")
    parser.add_argument("--log", action="append", help="only logs whose name begins so")
    parser.add_argument("--start", choices=("auto", "warm", "cold"), default="auto")
    options = parser.parse_args(arguments)
    use_kernel_cache()
    logs = sorted(options.logs.glob("*.ulg"))
    if options.log:
        logs = [log for log in logs if log.stem.startswith(tuple(options.log))]
    if not logs:
        parser.error(f"{options.logs} holds no such log")
    changes: Counter[tuple[str, str]] = Counter()

    def count(before: str, after: str) -> None:
        changes[before, after] += 1

    lines = [_line(HEADER), _line(["---"] * len(HEADER))]
    for cells in rows(logs, StartSettings(mode=options.start), count):
        lines.append(_line(cells))
        if options.document is None:
            print(*(lines if len(lines) == 3 else lines[-1:]), sep="\n", flush=True)
    lines += ["", _summary(changes)]
    if options.document is None:
        print(*lines[-2:], sep="\n")
    else:
        text = options.document.read_text(encoding="utf-8")
        options.document.write_text(between_marks(text, TABLE, "\n".join(lines)), encoding="utf-8")
    return 0


def _summary(changes: Counter[tuple[str, str]]) -> str:
    """How often each grade was given, and to how many logs another one."""
    before: Counter[str] = Counter()
    after: Counter[str] = Counter()
    for (first, second), number in changes.items():
        before[first] += number
        after[second] += number
    better = sum(number for (first, second), number in changes.items() if second < first)
    worse = sum(number for (first, second), number in changes.items() if second > first)
    told = ["/".join(str(one[grade]) for grade in "ABCD") for one in (before, after)]
    return f"A/B/C/D by {BASELINE}: {told[0]}; by the release that flew: {told[1]}; {better} better, {worse} worse."


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    raise SystemExit(main())
