"""Sets evaluated in memory: the scores are those that the pipeline's files hold, and nothing is written."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from fusetune.analyze.analyze_flight import AnalysisSettings, analyze_flight, grade_saved_flight
from fusetune.analyze.evaluate import evaluate
from fusetune.analyze.flight_files import FLIGHT_FILES, SAMPLES_FILE, SCORE_TABLES, SCORING_FILE
from fusetune.analyze.reconstruction.reconstructed_flight import BARO, IMU, MAG
from fusetune.analyze.replaying.prepared_flight import prepare_flight
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.analyze.replaying.store.parts import replay_files
from fusetune.analyze.replaying.store.row_groups import tables_in_groups
from fusetune.analyze.scoring.sample_scores import SAMPLES_SCHEMA
from fusetune.analyze.scoring.score_sets import score_sets, scored_flight
from fusetune.px4.flight import Flight, row_count, select_rows
from fusetune.px4.ulog.writer import write_ulog
from fusetune.save.flight_folder import load_flight, write_flight
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.parquet import write_table

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
    declared += [file for name in replayed for file in replay_files(written, name)]
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
    samples: list[pa.Table] = []
    with files_opened_for_writing() as opened:
        prepared = prepare_flight(load_flight(saved))
        replays = {name: replay_set(prepared, name, overrides) for name, overrides in SETS.items()}
        scores = evaluate(prepared, replays)
        score_sets(scored_flight(prepared.flight), replays.values(), take_samples=samples.append)
    assert opened == []
    assert list(empty.iterdir()) == []

    assert scores.summary["status"] == "scored"
    assert prepared.reconstructed.changed == (kind == "thinned")
    for table, file in SCORE_TABLES.items():
        assert getattr(scores, table).num_rows > 0
        write_table(getattr(scores, table), empty / file)
    with tables_in_groups(empty / SAMPLES_FILE, SAMPLES_SCHEMA) as take:
        for rows in samples:
            take(rows)
    write_document(empty / SCORING_FILE, scores.summary, sort_keys=True)
    for file in (*SCORE_TABLES.values(), SAMPLES_FILE, SCORING_FILE):
        assert (empty / file).read_bytes() == (written / file).read_bytes(), file


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
    write_ulog(tmp_path / "flight.ulg", survey_flight)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for block in blocks:
        exec(block, names)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [line[0] for line in lines] == ["present", "candidate", "0.1", "0.2", "0.4"]
    assert np.isfinite([float(line[1]) for line in lines]).all()
    assert len(blocks[0].splitlines()) <= 10
