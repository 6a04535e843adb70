"""Tuners of single effects, asked by causes."""

from __future__ import annotations

import pytest

from fusetune.analyze.diagnosis import told_effects
from fusetune.analyze.diagnosis.told_effects import EFFECTS, TUNERS, ToldEffects
from fusetune.analyze.effects.all_effects import all_effects
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.px4.flight import Flight


def test_what_was_told_already_is_taken_and_no_tuner_asked_again(
    survey_flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    observed = ObservedFlight(survey_flight)
    asked = {tuner: ask(observed) for tuner, ask in TUNERS.items()}
    assert {tuner: tuple(one.id for one in effects) for tuner, effects in asked.items()} == EFFECTS
    anew = ToldEffects(observed)
    expected = {tuner: anew(tuner) for tuner in TUNERS}
    assert any(expected.values())
    monkeypatch.setattr(told_effects, "TUNERS", {})
    told = ToldEffects(observed, all_effects(observed))
    assert {tuner: told(tuner) for tuner in EFFECTS} == expected
