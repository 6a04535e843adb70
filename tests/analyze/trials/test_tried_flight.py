"""Sets tried in memory compare as the pipeline's scores do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fusetune.analyze.evaluate import evaluate
from fusetune.analyze.replaying.prepared_flight import PreparedFlight, prepare_flight
from fusetune.analyze.replaying.settings import IN_USE
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.trials.tried_flight import TrialSettings, TriedFlight
from fusetune.analyze.trials.tried_set import ONE_STEP, SMOOTHED, WITHHELD
from fusetune.apply.evidence import AIDED, UNAIDED
from fusetune.apply.search.comparison import TriedBase, compare
from fusetune.apply.settings import DecisionSettings
from fusetune.px4.flight import Flight

SETTINGS = TrialSettings(IN_USE, ScoringSettings(), ("gnss_vel",), ("gnss_pos", "gnss_vel"))
CANDIDATE = {"EKF2_GPS_DELAY": 160.0, "EKF2_GPS_V_NOISE": 0.5}


@pytest.fixture(scope="module")
def prepared(survey_flight: Flight) -> PreparedFlight:
    return prepare_flight(survey_flight, SETTINGS.replayed)


@pytest.fixture(scope="module")
def tried(prepared: PreparedFlight) -> TriedFlight:
    return TriedFlight(prepared, {}, SETTINGS)


def test_only_what_is_compared_is_withheld() -> None:
    withheld = SETTINGS.replayed.withholding
    assert withheld is not None
    assert IN_USE.withholding is not None
    assert withheld.gnss_s == IN_USE.withholding.gnss_s
    assert (withheld.baro_s, withheld.mag_s) == (0.0, 0.0)


def test_the_sums_are_those_of_the_scores(survey_flight: Flight, tried: TriedFlight) -> None:
    """The scores clip at a limit of both sets, a trial at the base's: without clipping both are the same numbers."""
    scores = evaluate(prepare_flight(survey_flight), {"present": {}, "candidate": CANDIDATE})
    did = tried.try_set(CANDIDATE)
    assert {column.kind for column in did.sums} == {ONE_STEP, WITHHELD, SMOOTHED}
    for column, sums in did.sums.items():
        if column.kind == ONE_STEP:
            rows = scores.blocks.to_pylist()
            nis, number = "sum_nis", "n"
        elif column.kind == SMOOTHED:
            rows, nis, number = scores.smoothed.to_pylist(), "sum_squares", "n"
        else:
            rows = [row | {"square": row["error"] ** 2, "one": 1} for row in scores.withheld.to_pylist()]
            rows = [row for row in rows if row["horizon_s"] == column.horizon_s]
            nis, number = "square", "one"
        mine = [row for row in rows if (row["set"], row["source"], row["axis"]) == ("candidate", *column[1:3])]
        assert sum(row[number] for row in mine) == sums.n
        assert sums.nis <= sum(row[nis] for row in mine) * (1 + 1e-6)
        assert sums.nis == pytest.approx(sum(row[nis] for row in mine), rel=0.2)


def test_the_base_is_like_itself_and_a_set_does_not_depend_on_which_others_are_tried(tried: TriedFlight) -> None:
    alone = tried.try_set(CANDIDATE)
    tried.try_set({"EKF2_GPS_P_GATE": 1.0, "EKF2_BARO_GATE": 1.0})
    assert tried.try_set(CANDIDATE) == alone
    assert tried.try_set({}) == tried.base_set


def test_a_comparison_is_the_decisions(survey_flight: Flight, tried: TriedFlight) -> None:
    base = TriedBase(tried.reason, tried.whiteness, tried.base_set)
    found = compare([base], [[tried.base_set], [tried.try_set(CANDIDATE)]], DecisionSettings())
    assert found.differences[0] == pytest.approx([0.0], abs=1e-12)
    weighed = found.aims[AIDED][1], found.aims[UNAIDED][1]
    assert np.isfinite(weighed).all()
    assert min(weighed) <= found.differences[1] <= max(weighed)
    # a delay of 50 ms too much is worse in both
    assert found.differences[1] > 0.0


def test_a_set_that_does_not_work_says_why(tried: TriedFlight) -> None:
    did = tried.try_set({"EKF2_GPS_CTRL": 0, "EKF2_BARO_CTRL": 0, "EKF2_MAG_TYPE": 5})
    assert not did.sums or did.reason
    base = TriedBase(tried.reason, tried.whiteness, tried.base_set)
    found = compare([base], [[did]], DecisionSettings())
    assert np.isnan(found.differences).all()
    assert found.objections[0]


def test_a_flight_on_which_nothing_can_be_compared_says_why(prepared: PreparedFlight) -> None:
    long = replace(SETTINGS, scoring=ScoringSettings(minimum_scored_s=600.0))
    flight = TriedFlight(prepared, {}, long)
    assert "600 s are needed" in flight.reason
    assert not flight.base_set.sums
    base = TriedBase(flight.reason, flight.whiteness, flight.base_set)
    found = compare([base], [[flight.base_set]], DecisionSettings())
    assert not found.usable.any()
    assert np.isnan(found.means).all()
