"""The decision's evidence by manoeuvre: better in turns, equal in hover; and the decision by some alone."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.analyze.conformance.test_split_scores import made_conformance
from tests.analyze.made_flight import MadeSet
from tests.apply.study import make_study

from fusetune.analyze.conformance.split_scores import write_legs
from fusetune.analyze.flight.manoeuvre_classes import FLOWN_CLASSES
from fusetune.apply.by_manoeuvre import by_manoeuvre
from fusetune.apply.decide import decide
from fusetune.apply.evidence import AIDED, AimEvidence, AnalyzedFlight, FlightEvidence
from fusetune.apply.pieces_evidence import PiecesOfFlight, Words, evidence_in, in_classes
from fusetune.apply.settings import DecisionSettings
from fusetune.storage.documents import read_document, write_document

SETS = ("present", "turning")
COLUMNS = ("gnss_vel x", "gnss_vel y")
IN_TURNS = 0.88
"""Errors of the second set there, against the present one's."""


def made_flight(number: int) -> tuple[FlightEvidence, PiecesOfFlight]:
    """Six pieces of 100 samples, hover and turn in turn, whose variance differs from flight to flight."""
    variance = 1.0 + 0.1 * np.random.default_rng(number).random((6, 2))
    kinds = ["hover", "turn"] * 3
    rows = [
        (name, kind, piece, label, 100.0 * variance[piece, column] * (IN_TURNS**2 if is_turn else 1.0))
        for name in SETS
        for piece, kind in enumerate(kinds)
        for is_turn in [(name, kind) == (SETS[1], "turn")]
        for column, label in enumerate(COLUMNS)
    ]
    name, kind, piece, label, nis = zip(*rows, strict=True)
    pieces = PiecesOfFlight(
        "lanes", Words.of(name), Words.of(kind), np.array(piece), np.array(piece) // 3, Words.of([AIDED] * len(rows)),
        Words.of(label), np.full(len(rows), 100.0), np.array(nis), np.zeros(len(rows)),
    )  # fmt: skip
    sums = np.array(nis).reshape(2, 6, 2)
    aim = AimEvidence(AIDED, 1.0, COLUMNS, np.array([0.5, 0.5]), np.full((6, 2), 100.0), sums, np.zeros((2, 6, 2)))
    return FlightEvidence(f"flight_{number}", SETS, (aim,)), pieces


@pytest.fixture(scope="module")
def flights() -> list[tuple[FlightEvidence, PiecesOfFlight]]:
    return [made_flight(number) for number in range(5)]


def test_in_turns_better_in_hover_equal(flights: list[tuple[FlightEvidence, PiecesOfFlight]]) -> None:
    pieces = {one.flight: parts for one, parts in flights}
    found = by_manoeuvre([one for one, _ in flights], pieces, SETS, "present", DecisionSettings())
    by_class = {one.manoeuvre: one for one in found if one.manoeuvre}
    assert list(by_class) == ["hover", "turn"]
    assert by_class["hover"].difference == 0.0
    # the score is the logarithm of the error
    assert by_class["turn"].difference == pytest.approx(math.log(IN_TURNS))
    assert by_class["turn"].flights == 5
    # of the first three pieces of a flight one is a turn, of the last three two: by mean square over the leg's samples
    legs = {one.leg: one.difference for one in found if one.mission == "lanes"}
    assert list(legs) == [0, 1]
    assert legs[1] < legs[0] < 0.0


def test_the_pieces_of_all_classes_say_what_the_whole_flight_says(
    flights: list[tuple[FlightEvidence, PiecesOfFlight]],
) -> None:
    for whole, pieces in flights:
        found = evidence_in(whole, pieces, pieces.of_classes(FLOWN_CLASSES))
        assert found is not None
        assert found.scores == pytest.approx(whole.scores, rel=1e-12)
        assert evidence_in(whole, pieces, pieces.of_classes(["climb"])) is None


def test_a_flight_without_the_classes_that_alone_count_has_no_evidence(
    flights: list[tuple[FlightEvidence, PiecesOfFlight]],
) -> None:
    whole, pieces = flights[0]
    flight = AnalyzedFlight(whole.flight, Path(), {}, None, whole)
    settings = replace(DecisionSettings(), only_classes=("turn",))
    alone = in_classes(flight, {whole.flight: pieces}, "present", settings).evidence
    assert alone is not None
    assert alone.differences(SETS)[1] == pytest.approx(math.log(IN_TURNS))
    none = in_classes(flight, {whole.flight: pieces}, "present", replace(settings, only_classes=("climb", "descent")))
    assert none.evidence is None
    assert none.reason == "the flight holds too little of climb, descent to judge by"


def test_the_decision_tells_all_classes_and_rests_on_some_where_it_is_told_to(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.13), "better": MadeSet(error=0.1)}
    folders, table = make_study(tmp_path, sets, 5)
    for folder in folders:
        write_document(folder / "conformance.json", made_conformance(folder.name))
    write_legs(folders, tmp_path / "legs.parquet")
    told = {}
    for name, classes in (("all", ()), ("every", FLOWN_CLASSES), ("turn", ("turn",))):
        settings = replace(DecisionSettings(), only_classes=classes)
        decide(folders, table, tmp_path / name, sets=list(sets), legs=tmp_path / "legs.parquet", settings=settings)
        told[name] = read_document(tmp_path / name / "decision.json")
    rows = told["all"]["by_manoeuvre"]
    assert {one["manoeuvre"] for one in rows} == {"hover", "turn", "straight", ""}
    assert {one["leg"] for one in rows if one["mission"] == "lanes"} == {0, 1}
    assert all(one["difference"] < 0.0 and one["name"] == "better" for one in rows)
    assert told["turn"]["by_manoeuvre"] == rows

    def difference(name: str) -> float:
        return next(one["difference"] for one in told[name]["ranking"] if one["name"] == "better")

    assert difference("every") == pytest.approx(difference("all"), abs=1e-6)
    turn = next(one["difference"] for one in rows if one["manoeuvre"] == "turn")
    assert difference("turn") == pytest.approx(turn, rel=1e-6)
    assert "Of each flight its turn alone counts" in told["turn"]["paragraph"]
    assert "alone counts" not in told["all"]["paragraph"]
