"""Tuners of single effects, asked by causes."""

from __future__ import annotations

import pytest

from fusetune.analyze.diagnosis.told_effects import ToldEffects
from fusetune.analyze.effects import all_effects
from fusetune.analyze.effects.all_effects import TUNERS, FlightEffects
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.px4.flight import Flight


def test_what_was_told_already_is_taken_and_no_tuner_asked_again(
    survey_flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    effects = FlightEffects(ObservedFlight(survey_flight))
    told_first = {one.name: one for effect in effects.all() for one in effect.estimates}
    assert told_first
    tuners = tuple(TUNERS)
    monkeypatch.setattr(all_effects, "TUNERS", {})
    told = ToldEffects(effects)
    assert {name: one for tuner in tuners for name, one in told(tuner).items()} == told_first
    assert ToldEffects(None)(tuners[0]) == {}
