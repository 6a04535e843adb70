"""Logs put together otherwise end in verdicts: some cases of `benchmarks/restructured_logs.py`, which runs 1000."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks.damage_cases import CaseError, sound_case
from benchmarks.restructured_logs import WAYS, Restructurer, run_case, run_cases
from benchmarks.ulog_parts import Parts

CASES = len(WAYS)
"""Every way comes once as the first."""


def test_every_case_ends_in_a_verdict(tmp_path: Path) -> None:
    outcome = run_cases(range(1, CASES + 1), tmp_path)
    assert outcome.failures == {}
    assert outcome.tally["replayable"] + outcome.tally["refused"] == CASES
    assert min(outcome.tally["replayable"], outcome.tally["refused"]) > CASES // 10


def test_a_case_is_its_number(tmp_path: Path) -> None:
    restructurer = Restructurer(sound_case(tmp_path).content)
    assert restructurer.mutated(7) == restructurer.mutated(7)
    assert restructurer.mutated(7) != restructurer.mutated(8)


def test_parts_make_the_log_again(tmp_path: Path) -> None:
    sound = sound_case(tmp_path).content
    parts = Parts.of(sound)
    assert parts.content() == sound
    for message_id in parts.topics:
        places, messages = parts.messages(message_id)
        assert len(places) == len(parts.rows(message_id)) > 0
        parts.replace(message_id, places, messages)
    assert parts.content() == sound


def test_additions_that_change_the_flight_and_faults_that_are_not_told_would_be_found(tmp_path: Path) -> None:
    sound = sound_case(tmp_path)
    assert run_case(sound.content, "unknown_records", tmp_path, sound) == "replayable"
    with pytest.raises(CaseError, match="no warning tells of it"):
        run_case(sound.content, "stuck_sensor", tmp_path, sound)
    parts = Parts.of(sound.content)
    message_id = parts.message_id("vehicle_air_data")
    places, messages = parts.messages(message_id)
    messages["baro_alt_meter"] += 1.0
    parts.replace(message_id, places, messages)
    with pytest.raises(CaseError, match="are not those of the sound log"):
        run_case(parts.content(), "unknown_records", tmp_path, sound)
    del parts.data[places[0]]
    with pytest.raises(CaseError, match="samples of vehicle_air_data are missing"):
        run_case(parts.content(), "unknown_records", tmp_path, sound)
