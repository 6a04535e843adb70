"""Scores of a flight as files: `fusetune.analyze.flight_files` but for `fidelity.json`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from fusetune.analyze.flight_files import ONBOARD_FILE, SAMPLES_FILE, SCORE_TABLES, SCORING_FILE
from fusetune.analyze.replaying.onboard import onboard_samples, write_onboard
from fusetune.analyze.replaying.samples import AxisSamples, SampleSpool, SourceAxis
from fusetune.analyze.replaying.store.reader import read_innovations, read_set
from fusetune.analyze.replaying.store.row_groups import tables_in_groups
from fusetune.analyze.scoring.score_sets import SCORE_TOPICS, FlightScores, joined_summary, scored_flight
from fusetune.analyze.scoring.set_scores import TABLES, SetScores, score_flight, score_set
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.yardstick import WITH_MEASURED_ANTENNA, Yardstick
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.save.flight_folder import load_flight
from fusetune.set_names import PRESENT
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.freed_memory import give_back_freed_memory

_FILES = {**SCORE_TABLES, "samples": SAMPLES_FILE}


def score_saved_flight(
    flight_folder: AnyPath,
    analyze_folder: AnyPath,
    sets: Sequence[str],
    *,
    present: str = PRESENT,
    settings: ScoringSettings | None = None,
) -> None:
    """Score the replays of a saved flight, `results/save/<flight>`, that are in the store, and write the files.

    Parameters
    ----------
    analyze_folder : holds the replays of all sets, `results/analyze/<flight>`
    sets : names of the sets, the present one among them or added

    Raises
    ------
    UserError
        If a file of a replay is missing or damaged. A flight that cannot be scored is no error: its files say why.
    """
    folder = Path(analyze_folder)
    flight = canonical(load_flight(flight_folder, topics=SCORE_TOPICS))
    write_onboard(folder / ONBOARD_FILE, onboard_samples(flight))
    scored = scored_flight(flight, settings, read_onboard(folder))
    del flight
    spool = SampleSpool(folder)
    replays = {name: read_set(folder, name, spool) for name in dict.fromkeys((present, *sets))}
    antenna = next((one for name, one in replays.items() if name in WITH_MEASURED_ANTENNA), None)
    yardstick = Yardstick(scored, replays[present], settings, antenna)
    with scores_writer(folder) as writer:
        for name, record in replays.items():
            writer.take(name, score_set(yardstick, record))
            give_back_freed_memory()
        writer.finish(score_flight(yardstick))


def read_onboard(analyze_folder: AnyPath) -> Mapping[SourceAxis, AxisSamples]:
    """The vehicle's innovations from `onboard.innovations.parquet`, so that the log need not stay in memory."""
    return read_innovations(Path(analyze_folder) / ONBOARD_FILE, {})


class ScoresWriter:
    """Takes the scores of one set after the other; `scores_writer` makes one."""

    def __init__(self, folder: AnyPath, takers: Mapping[str, Any]) -> None:
        self._folder, self._takers = Path(folder), takers
        self._summaries: dict[str, dict[str, Any]] = {}

    def take(self, name: str, scores: SetScores) -> None:
        """Write the scores of a set."""
        for table, taker in self._takers.items():
            taker(getattr(scores, table))
        self._summaries[name] = scores.summary

    def finish(self, flight: SetScores) -> None:
        """Write the flight's own figures, and `scoring.json`."""
        for table, taker in self._takers.items():
            taker(getattr(flight, table))
        _write_summary(self._folder, joined_summary(flight, self._summaries))


@contextmanager
def scores_writer(folder: AnyPath) -> Iterator[ScoresWriter]:
    """Write the scores of a flight set by set, so that no more than some are in memory; the tables appear when all are
    whole."""
    with ExitStack() as stack:
        takers = {
            table: stack.enter_context(tables_in_groups(Path(folder) / file, TABLES[table]))
            for table, file in _FILES.items()
        }
        yield ScoresWriter(Path(folder), takers)


def write_flight_scores(folder: AnyPath, scores: FlightScores) -> None:
    """Write the figures of a flight to a folder, which must exist: all of `SCORE_TABLES`, and the summary."""
    folder = Path(folder)
    for table, name in SCORE_TABLES.items():
        with tables_in_groups(folder / name, TABLES[table]) as take:
            take(getattr(scores, table))
    _write_summary(folder, scores.summary)


def _write_summary(folder: Path, summary: Mapping[str, Any]) -> None:
    with atomic_path(folder / SCORING_FILE) as temporary:
        write_document(temporary, summary, lines=2, sort_keys=True)
