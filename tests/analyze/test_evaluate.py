"""Sets evaluated in memory: the scores are those that the pipeline's files hold, and nothing is written."""

from __future__ import annotations

import json
import os
import re
import sqlite3
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from fusetune.analyze.analyze_flight import AnalysisSettings, MadeWith, analyze_flight, grade_saved_flight
from fusetune.analyze.evaluate import evaluate
from fusetune.analyze.flight_files import FLIGHT_FILES, KEPT_SCORES_FILE, SAMPLES_FILE, SCORE_TABLES, SCORING_FILE
from fusetune.analyze.reconstruction.reconstructed_flight import BARO, IMU, MAG
from fusetune.analyze.replaying import prepared_flight
from fusetune.analyze.replaying.prepared_flight import prepare_flight
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.analyze.replaying.store.parts import TABLES, replay_files, table_file
from fusetune.analyze.scoring import yardstick
from fusetune.analyze.scoring.score_flight import write_flight_scores
from fusetune.px4.flight import Flight, row_count, select_rows
from fusetune.px4.ulog.writer import write_ulog
from fusetune.save.flight_folder import load_flight, write_flight
from fusetune.storage.documents import read_document
from fusetune.storage.parquet import read_table

# the delay gives other times to the same measurements, the gate rejects some of them
SETS: dict[str, dict[str, float]] = {
    "present": {},
    "delayed": {"EKF2_GPS_DELAY": 160.0, "EKF2_GPS_V_NOISE": 0.5},
    "narrow": {"EKF2_GPS_P_GATE": 1.0, "EKF2_BARO_GATE": 1.0},
}

WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_opened: list[str] = []
_watching = False


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    if _watching and event == "open" and isinstance(arguments[2], int) and arguments[2] & WRITES:
        _opened.append(str(arguments[0]))


# stays for good, as all audit hooks do
sys.addaudithook(_note)


@contextmanager
def files_opened_for_writing() -> Iterator[list[str]]:
    global _watching
    _opened.clear()
    _watching = True
    try:
        yield _opened
    finally:
        _watching = False


def thinned(flight: Flight) -> Flight:
    """As a logger thins it: some IMU rows lost, magnetometer and barometer at a tenth of their rates."""
    imu = flight.topics[IMU, 0]
    lost = np.random.default_rng(3).random(row_count(imu)) < 0.04
    topics = {key: table for key, table in flight.topics.items() if key[0] != "ekf2_timestamps"}
    topics[IMU, 0] = select_rows(imu, ~lost)
    for topic in (MAG, BARO):
        topics[topic, 0] = select_rows(topics[topic, 0], np.arange(0, row_count(topics[topic, 0]), 10))
    return flight.with_topics(topics)


@pytest.mark.parametrize("kind", ["whole", "thinned"])
def test_scores_in_memory_are_those_of_the_files(
    survey_flight: Flight, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved, written, empty = tmp_path / "flight", tmp_path / "analyze", tmp_path / "empty"
    saved.mkdir()
    empty.mkdir()
    write_flight(saved, survey_flight if kind == "whole" else thinned(survey_flight))
    replayed = {**SETS, "as_flown": {}}
    analyze_flight(saved, written, replayed, list(SETS))
    declared = [written / name for name in FLIGHT_FILES]
    declared += [file for name in ("present", "as_flown") for file in replay_files(written, name)]
    assert set(written.iterdir()) == set(declared)
    # the grade that may be asked for before all this is the same
    trust = read_document(written / "fidelity.json")["trust"]
    early = grade_saved_flight(saved, AnalysisSettings())
    assert (early.grade, early.is_compared, early.figure_grades) == (
        trust["grade"],
        trust["is_compared"],
        trust["figure_grades"],
    )

    monkeypatch.chdir(empty)
    with files_opened_for_writing() as opened:
        prepared = prepare_flight(load_flight(saved))
        replays = {name: replay_set(prepared, name, overrides) for name, overrides in SETS.items()}
        scores = evaluate(prepared, replays)
    assert opened == []
    assert list(empty.iterdir()) == []

    assert scores.summary["status"] == "scored"
    assert prepared.reconstructed.changed == (kind == "thinned")
    write_flight_scores(empty, scores)
    for file in (*SCORE_TABLES.values(), SCORING_FILE):
        assert (empty / file).read_bytes() == (written / file).read_bytes(), file
    assert read_table(written / SAMPLES_FILE).equals(scores.samples)
    # each set by itself, and the others', in whatever order and recorded in full
    for name in ("narrow", "delayed"):
        alone = evaluate(prepared, {"present": replays["present"], name: SETS[name]})
        for table in SCORE_TABLES:
            whole, part = (getattr(one, table).to_pandas() for one in (scores, alone))
            whole, part = (one[one["set"] == name].reset_index(drop=True) for one in (whole, part))
            pd.testing.assert_frame_equal(whole, part, check_exact=True)
        assert alone.summary["sets"][name] == scores.summary["sets"][name]


def test_one_more_set_costs_only_its_own(
    survey_flight: Flight, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same files as all at once, also by several threads and as of a flight that is too long to keep in memory;
    what is kept of the others is not touched."""
    saved, grown, whole = tmp_path / "flight", tmp_path / "grown", tmp_path / "whole"
    saved.mkdir()
    write_flight(saved, survey_flight)
    replayed = {**SETS, "as_flown": {}}
    made_with = MadeWith("replay", "scores")

    def analyze(folder: Path, names: list[str], threads: int = 1) -> tuple[str, ...]:
        sets = {name: replayed[name] for name in (*names, "as_flown")}
        return analyze_flight(saved, folder, sets, names, made_with=made_with, threads=threads)

    with monkeypatch.context() as long:
        long.setattr(prepared_flight, "MOST_IN_MEMORY", 0)
        long.setattr(yardstick, "MOST_KEPT_STATES", 0)
        assert analyze(whole, list(SETS), threads=2) == ("present", "as_flown", "delayed", "narrow")
    assert any(source.startswith("truth_") for source in read_table(whole / "metrics.parquet")["source"].to_pylist())
    assert not [file for file in whole.iterdir() if file.is_dir()]
    assert analyze(grown, ["present", "narrow"]) == ("present", "as_flown", "narrow")
    former = replay_files(grown, "delayed")
    for file in former:
        file.write_bytes(b"of an earlier version")
    kept = {name: pieces_of(grown)[row] for name, row in rows_of(grown).items()}
    assert analyze(grown, list(SETS)) == ("delayed",)
    assert not any(file.exists() for file in former)
    after = pieces_of(grown)
    assert {name: after[row] for name, row in rows_of(grown).items() if name in kept} == kept
    assert analyze(grown, list(SETS)) == ()
    for file in FLIGHT_FILES:
        assert (grown / file).read_bytes() == (whole / file).read_bytes(), file
    # as flown the present values: one replay
    for table in TABLES:
        flown, present = (table_file(grown, name, table).read_bytes() for name in ("as_flown", "present"))
        assert flown == present, table
    # a damaged piece, or file, is made again
    with sqlite3.connect(grown / KEPT_SCORES_FILE) as database:
        database.execute("UPDATE kept SET tables = 'spoiled' WHERE number = ?", (rows_of(grown)["narrow"],))
    # it was scored with the present set
    assert analyze(grown, list(SETS)) == ("present", "narrow")
    (grown / KEPT_SCORES_FILE).write_bytes(b"no database at all, but long enough to look like one" * 100)
    assert analyze(grown, list(SETS)) == ("present", "delayed", "narrow")
    for file in FLIGHT_FILES:
        assert (grown / file).read_bytes() == (whole / file).read_bytes(), file


def rows_of(folder: Path) -> dict[str, int]:
    """The rows of the sets in the file that keeps scores."""
    with closing(sqlite3.connect(folder / KEPT_SCORES_FILE)) as database:
        heads = database.execute("SELECT number, head FROM kept").fetchall()
    found = [(number, one["summary"]) for number, head in heads for one in json.loads(head)]
    by_overrides = {json.dumps(one["overrides"]): number for number, one in found if "overrides" in one}
    return {
        name: by_overrides[json.dumps(values)] for name, values in SETS.items() if json.dumps(values) in by_overrides
    }


def pieces_of(folder: Path) -> dict[int, tuple]:
    """What is kept in each row."""
    with closing(sqlite3.connect(folder / KEPT_SCORES_FILE)) as database:
        return {row[0]: row for row in database.execute("SELECT * FROM kept")}


def test_a_replay_at_hand_is_as_good_as_one_made_anew(survey_flight: Flight) -> None:
    prepared = prepare_flight(survey_flight)
    anew = evaluate(prepared, {"present": {}, "delayed": SETS["delayed"]})
    now = replay_set(prepared, "present", {})
    again = evaluate(prepared, {"delayed": SETS["delayed"], "present": now})
    assert again.blocks.equals(anew.blocks)
    assert again.summary == anew.summary
    with pytest.raises(KeyError):
        evaluate(prepared, {"delayed": now})
    with pytest.raises(KeyError, match="no_such_metric"):
        anew.figure("present", "gnss_vel", "all", "no_such_metric")


def test_the_examples_in_the_docs_run(
    survey_flight: Flight, project_root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (project_root / "docs/library.md").read_text(encoding="utf-8"), re.S)
    for name in ("flight.ulg", "log.ulg"):
        write_ulog(tmp_path / name, survey_flight)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    assert len(blocks) == 2
    for block in blocks:
        exec(block, names)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [line[0] for line in lines] == ["0.1", "0.2", "0.4"]
    assert np.isfinite([float(line[1]) for line in lines]).all()
    assert len(blocks[0].splitlines()) <= 10
