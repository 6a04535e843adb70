"""What a pilot is told of delays."""

from dataclasses import asdict
from pathlib import Path

import pyarrow.compute as pc
import pytest
from tests.analyze.made_flight import MadeSet
from tests.apply.study import make_study
from tests.apply.test_choice import one

from fusetune.analyze.delays.wrong_delays import JoinedDelay
from fusetune.apply.choice import Choice
from fusetune.apply.decide import decide
from fusetune.apply.delays import SINGLE, UNCONFIRMED, UNTRIED, WRONG, confirmed, delay_findings, delay_sentences
from fusetune.apply.evidence import AIDED, read_flights
from fusetune.apply.settings import DecisionSettings
from fusetune.px4.parameters.params_file import read_params
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.parquet import read_table, write_table


def joined(value: float, mended: float | None, flights: tuple[str, ...] = ("a", "b", "c")) -> JoinedDelay:
    return JoinedDelay("gnss", "EKF2_GPS_DELAY", 110.0, value, value - 7.0, value + 7.0, flights, mended, 200.0)


def test_a_wrong_delay_is_told_with_the_value_to_set() -> None:
    (found,) = delay_findings([joined(145.0, 140.0)])
    assert (found.id, found.severity, found.figure, found.threshold) == (WRONG, "warning", 145.0, 110.0)
    assert delay_sentences([found]) == (
        "GNSS arrives 145 ms after its measurement (95 % interval 138 to 152 ms), and PX4 is told EKF2_GPS_DELAY = "
        "110: set EKF2_GPS_DELAY to 140."
    )


def test_a_delay_that_the_predictions_speak_against_is_told_but_not_set() -> None:
    findings = delay_findings([joined(145.0, 140.0)])
    mended = one("delay_mended", 0.02, 0.1, worse_aims=("smoothed",))
    keep = Choice("keep", "present", mended, None, False, None)
    (found,) = confirmed(findings, keep, [mended])
    assert (found.id, found.severity) == (UNCONFIRMED, "note")
    assert "not set, as the present parameters are worse with it beyond doubt in one way" in delay_sentences([found])
    change = Choice("change", "delay_mended", mended, mended, False, None)
    assert confirmed(findings, change, [mended]) == findings


def test_a_delay_beyond_the_buffers_asks_for_longer_ones() -> None:
    """(230 + 10) ms in updates of 8 ms, which count as 10: 300."""
    (found,) = delay_findings([joined(231.0, 230.0)])
    assert (
        found.remedy
        == "Set EKF2_GPS_DELAY to 230, and EKF2_DELAY_MAX, now 200, to 300, as EKF2 reaches no further back"
    )


def test_one_flight_alone_is_worth_a_note() -> None:
    (found,) = delay_findings([joined(205.0, None, ("a",))])
    assert (found.id, found.severity) == (SINGLE, "note")
    assert delay_sentences([found]) == ""


def test_a_way_of_estimating_that_was_not_tried_mends_nothing_but_is_told() -> None:
    flow = JoinedDelay("flow", "EKF2_OF_DELAY", 20.0, 60.0, 50.0, 70.0, ("a", "b"), None, 200.0)
    (found,) = delay_findings([flow])
    assert (found.id, found.severity) == (UNTRIED, "note")
    assert "Compare sets with other values of EKF2_OF_DELAY" in found.remedy
    assert delay_sentences([found]) == ""


@pytest.mark.parametrize("one", [joined(112.0, None), joined(112.0, None, ("a",))])
def test_of_a_right_delay_nothing_is_said(one: JoinedDelay) -> None:
    assert delay_findings([one]) == ()


PRESENT, MENDED = {"EKF2_GPS_DELAY": 110.0}, {"EKF2_GPS_DELAY": 200.0}
SETS = {"present": MadeSet(error=0.13, overrides=PRESENT), "delay_mended": MadeSet(error=0.1, overrides=MENDED)}


def test_a_set_with_the_delay_mended_is_chosen_like_any_other_and_the_delay_is_told_first(tmp_path: Path) -> None:
    folders, table = make_study(tmp_path, SETS)
    file = tmp_path / "delays.json"
    write_document(file, {"delays": [asdict(joined(203.0, 200.0))], "mended": MENDED})
    decide(folders, table, tmp_path / "apply", sets=list(SETS), newest_flight=folders[-1].name, delays=file)
    decision = read_document(tmp_path / "apply" / "decision.json")
    assert decision["paragraph"].startswith("GNSS arrives 203 ms after its measurement")
    assert decision["findings"][0]["id"] == WRONG
    assert (decision["status"], decision["chosen"]) == ("change", "delay_mended")
    (entry,) = read_params(tmp_path / "apply" / "best_params.params")
    assert (entry.name, entry.value) == ("EKF2_GPS_DELAY", 200.0)


def test_how_white_a_source_is_comes_from_the_set_with_the_delay_mended(tmp_path: Path) -> None:
    """With a wrong delay the error of a source holds the acceleration, so the present set calls it coloured."""
    folders, _ = make_study(tmp_path, SETS, 1)
    file = folders[0] / "metrics.parquet"
    rows = read_table(file)
    told = pc.and_(pc.equal(rows["metric"], "white_share"), pc.equal(rows["set"], "present"))
    coloured = pc.if_else(told, 0.1, rows["value"])
    write_table(rows.set_column(rows.schema.get_field_index("value"), "value", coloured), file)

    def weights(present: str) -> list[str]:
        (flight,) = read_flights(folders, DecisionSettings(), present)
        assert flight.evidence is not None
        return [aim.name for aim in flight.evidence.aims]

    assert AIDED in weights("present")
    mended = pc.and_(pc.equal(rows["metric"], "white_share"), pc.equal(rows["set"], "delay_mended"))
    both = pc.if_else(pc.or_(told, mended), 0.1, rows["value"])
    write_table(rows.set_column(rows.schema.get_field_index("value"), "value", both), file)
    assert AIDED not in weights("present")
