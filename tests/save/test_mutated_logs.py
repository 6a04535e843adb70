"""Damaged logs end in verdicts: the first cases of `benchmarks/mutated_logs.py`, which runs 2000."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks.damage_cases import CaseError, sound_case
from benchmarks.mutated_logs import Mutator, run_case, run_cases

CASES = 60


def test_every_case_ends_in_a_verdict(tmp_path: Path) -> None:
    outcome = run_cases(range(1, CASES + 1), tmp_path)
    tally = outcome.tally
    assert outcome.failures == {}
    assert tally["replayable"] + tally["refused"] == CASES
    # both ends occur, so the cases neither spare the log nor destroy it
    assert min(tally["replayable"], tally["refused"]) > CASES // 10


def test_a_case_is_its_number(tmp_path: Path) -> None:
    mutator = Mutator(sound_case(tmp_path).content)
    assert mutator.mutated(7) == mutator.mutated(7)
    assert mutator.mutated(7) != mutator.mutated(8)


def test_silent_changes_would_be_found(tmp_path: Path) -> None:
    """The sound log with another sound log's samples passes every check, but is not the sound log."""
    sound = sound_case(tmp_path)
    table = dict(sound.tables["vehicle_air_data"])
    table["baro_alt_meter"] = table["baro_alt_meter"] + 1.0
    other = type(sound)(sound.content, sound.warnings, sound.tables | {"vehicle_air_data": table})
    assert run_case(sound.content, tmp_path, sound) == "replayable"
    with pytest.raises(CaseError, match="240 samples of vehicle_air_data"):
        run_case(sound.content, tmp_path, other)
