"""Scores of a flight whose replays are in the store, written beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fusetune.analyze.flight_files import ONBOARD_FILE, SAMPLES_FILE, SCORE_TABLES, SCORING_FILE
from fusetune.analyze.replaying.onboard import onboard_samples, write_onboard
from fusetune.analyze.replaying.samples import AxisSamples, SampleSpool, SourceAxis
from fusetune.analyze.replaying.store.reader import read_innovations, read_set
from fusetune.analyze.replaying.store.row_groups import tables_in_groups
from fusetune.analyze.scoring.sample_scores import SAMPLES_SCHEMA
from fusetune.analyze.scoring.score_sets import SCORE_TOPICS, FlightScores, ScoredFlight, score_sets, scored_flight
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.save.flight_folder import load_flight
from fusetune.set_names import PRESENT
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.parquet import write_table


def score_saved_flight(
    flight_folder: AnyPath,
    analyze_folder: AnyPath,
    sets: Sequence[str],
    *,
    present: str = PRESENT,
    settings: ScoringSettings | None = None,
) -> None:
    """Score the replays of a saved flight, `results/save/<flight>`; all else as in `write_scores`.

    Raises
    ------
    UserError
        If a file of a replay is missing or damaged. A flight that cannot be scored is no error: its files say why.
    """
    flight = canonical(load_flight(flight_folder, topics=SCORE_TOPICS))
    write_onboard(Path(analyze_folder) / ONBOARD_FILE, onboard_samples(flight))
    scored = scored_flight(flight, settings, read_onboard(analyze_folder))
    del flight
    write_scores(scored, analyze_folder, sets, present=present, settings=settings)


def read_onboard(analyze_folder: AnyPath) -> Mapping[SourceAxis, AxisSamples]:
    """The vehicle's innovations from `onboard.innovations.parquet`, so that the log need not stay in memory."""
    return read_innovations(Path(analyze_folder) / ONBOARD_FILE, {})


def write_scores(
    scored: ScoredFlight,
    analyze_folder: AnyPath,
    sets: Sequence[str],
    *,
    present: str = PRESENT,
    settings: ScoringSettings | None = None,
) -> None:
    """Score the replays of a flight and write the files of `fusetune.analyze.flight_files`, but `fidelity.json`.

    Parameters
    ----------
    analyze_folder : holds the replays of all sets, `results/analyze/<flight>`
    sets : names of the sets, the present one among them or added
    """
    folder = Path(analyze_folder)
    spool = SampleSpool(folder)
    replays = [read_set(folder, name, spool) for name in dict.fromkeys((present, *sets))]
    with tables_in_groups(folder / SAMPLES_FILE, SAMPLES_SCHEMA) as take_samples:
        scores = score_sets(
            scored, replays, present=present, settings=settings, take_samples=take_samples, spool_folder=folder
        )
    write_flight_scores(folder, scores)


def write_flight_scores(folder: AnyPath, scores: FlightScores) -> None:
    """Write the figures of a flight to a folder, which must exist: all of `SCORE_TABLES`, and the summary."""
    folder = Path(folder)
    for table, name in SCORE_TABLES.items():
        with atomic_path(folder / name) as temporary:
            write_table(getattr(scores, table), temporary)
    with atomic_path(folder / SCORING_FILE) as temporary:
        write_document(temporary, scores.summary, sort_keys=True)
