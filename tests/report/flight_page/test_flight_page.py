"""The page of a flight: the answer first, then why, all of it in one file."""

from __future__ import annotations

import base64
from dataclasses import replace
from pathlib import Path

import pytest
from tests.report.made_health import LATE, SHAKEN, SILENT, health_rows, rejected, write_documents, write_log
from tests.report.read_page import check_page, told

from fusetune.analyze.diagnosis.diagnosis import Sign
from fusetune.errors import UserError
from fusetune.report.flight_data.blob import unpack
from fusetune.report.flight_data.write_blob import pack_flight
from fusetune.report.flight_page.page import build_flight_page
from fusetune.storage.documents import read_document, write_document


def page_of(folder: Path, blob: bytes | None = None) -> str:
    output = folder.parent.parent / "report" / "flights" / f"{folder.name}.html"
    build_flight_page(folder, output, {"The decision": folder.parent.parent / "report.html"}, blob)
    return check_page(output.read_text(encoding="utf-8")).source


@pytest.fixture(scope="module")
def shaken(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A flight with two causes and two figures beyond their limits, shown over time."""
    root = tmp_path_factory.mktemp("results")
    problems = (rejected("gnss_vel_vertical", 0.2, 22.0, 30.0), rejected("baro_hgt", 0.02, 24.0, 25.0, "warning"))
    folder = write_documents(root / "analyze" / "shaken", (SHAKEN, LATE), health_rows(*problems))
    blob = pack_flight(write_log(root / "save" / "shaken"), folder)
    assert blob
    return page_of(folder, blob)


def test_the_answer_stands_first(shaken: str) -> None:
    words = told(shaken)
    order = [
        "The &lt;frame&gt; shakes the IMU do not fly like this",
        "10.0 s after take-off, 12.5 s long",
        "sure (97 %)",
        "Isolate the autopilot.",
        "Also: GNSS is later than PX4 is told worth knowing",
        "What the log shows",
        "What the replay shows",
        "What was tried",
        "EKF2_ACC_NOISE = 0.5",
        "What could be set from this flight",
        "Health of sensors and filter",
    ]
    places = [words.index(one) for one in order]
    assert places == sorted(places)


def test_the_head_tells_whose_estimator_replays_the_flight(tmp_path: Path) -> None:
    folder = write_documents(tmp_path / "analyze" / "newer", (SHAKEN,), health_rows())
    health = read_document(folder / "health.json")
    write_document(folder / "health.json", health | {"firmware": "v1.17.0", "replayed_why": "v1.17 is none of them"})
    assert "v1.17.0, replayed as v1.16 (v1.17 is none of them)" in told(page_of(folder))
    refused = write_documents(tmp_path / "analyze" / "bad", (), refused=[{"found": "no IMU", "remedy": "log it"}])
    assert "replayed as" not in told(page_of(refused))


def test_a_sign_tells_what_is_usual_unless_its_words_do(shaken: str) -> None:
    words = told(shaken)
    assert "18.9 m/s² (usual: up to 4.9 m/s²)" in words
    assert "the bias moves by 0.4 m/s² in the air" in words
    assert "in the air (usual" not in words


def test_an_experiment_is_no_evidence_and_told_apart(shaken: str) -> None:
    words = told(shaken)
    showed, tried = words.index("What the replay shows"), words.index("What was tried")
    assert "ACC_NOISE" not in words[showed:tried]
    assert words[tried:].startswith(
        "What was tried and measured What was tried The replay with EKF2_ACC_NOISE 0.8 is no better"
    )


def test_a_cause_of_the_whole_flight_says_so(shaken: str) -> None:
    second = told(shaken).split("GNSS is later than PX4 is told")[-1]
    assert "when all of the flight how sure possible (60 %)" in second


def test_the_page_needs_no_network(shaken: str) -> None:
    page = check_page(shaken)
    assert {link for link in page.links if not link.startswith("#")} == {"../../report.html"}
    assert "<frame>" not in shaken


def test_the_flight_is_shown_over_time_and_causes_lead_there(shaken: str, tmp_path: Path) -> None:
    page = check_page(shaken)
    (viewer,), (data,) = page.all("div", "flight-viewer"), page.all("script", "flight-data")
    assert viewer.attributes["data-flight"] == data.attributes["data-flight"] == "shaken"
    assert unpack(base64.b64decode(data.text)).header["flight"] == "shaken"
    leads = [one for one in page.all("a") if one.attributes["href"] == "#viewer"]
    assert [one.attributes["data-state"] for one in leads] == ["t=20.0,32.5", "t=10.0,50.0"]
    without = page_of(write_documents(tmp_path / "analyze" / "flight", (SHAKEN,)))
    assert "flight-viewer" not in without.partition("<body")[2]
    assert "#viewer" not in without


def test_problems_stand_before_passes_and_these_behind_a_click(shaken: str) -> None:
    health = shaken[shaken.index("Health of sensors and filter") :].replace("&nbsp;", " ")
    assert health.index("gnss_vel_vertical: samples rejected: 20 %") < health.index("baro_hgt: samples rejected: 2 %")
    assert health.index("baro_hgt: samples rejected") < health.index("<details>")
    assert "12.0 s after take-off, 8.0 s long" in health
    assert health.index("<details>") < health.index("horizontal accuracy")
    assert "range finder: not in the log" in health[health.index("1 figure that this log does not tell") :]


def test_effects_say_what_to_make_of_them(shaken: str) -> None:
    """EKF2_BCOEF_X flies 100 and is told to lie between 50 and 70; EKF2_MCOEF flies within its interval."""
    effects = shaken[shaken.index("What could be set") : shaken.index("Health of sensors")]
    rows = {row.split("<td")[2].split(">")[1].split("<")[0]: row for row in effects.split("<tr>")[2:] if "mono" in row}
    assert "try 60" in rows["EKF2_BCOEF_X"]
    assert "agrees with what flies" in rows["EKF2_MCOEF"]
    assert "measured; no parameter says it" in rows["wind_north"]
    assert "it never came near the ground; hover half a metre high" in effects


def test_a_sound_flight_is_said_to_be_sound(tmp_path: Path) -> None:
    words = told(page_of(write_documents(tmp_path / "analyze" / "sound", effects=(SILENT,))))
    assert "Nothing wrong was found on this flight" in words
    assert "No figure lies beyond its limit." in words
    assert "This flight tells none of them" in words
    assert "Why" not in words.split("What could be set")[0]


def test_a_log_that_cannot_be_read_is_not_said_to_be_sound(tmp_path: Path) -> None:
    refused = {"found": "the log is empty", "remedy": "Copy the log from the vehicle once more"}
    folder = write_documents(tmp_path / "analyze" / "x", rows=(), effects=(), refused=(refused,), readable=False)
    words = told(page_of(folder))
    assert "This log cannot be read Nothing can be told of the flight: The log is empty. Copy the log" in words
    assert "Health of sensors" not in words
    assert "othing wrong" not in words


def test_a_refused_log_says_so_with_and_without_a_cause(tmp_path: Path) -> None:
    refused = {"found": "the IMU is logged at 20 Hz", "remedy": "Log it faster"}
    silent = told(page_of(write_documents(tmp_path / "analyze" / "silent", refused=(refused,))))
    assert "What this log tells is too little to say whether anything is wrong" in silent
    assert "othing wrong" not in silent
    found = told(page_of(write_documents(tmp_path / "analyze" / "found", (SHAKEN,), refused=(refused,))))
    assert found.index("shakes the IMU") < found.index("cannot be replayed, so less can be told of the flight:")
    for words in (silent, found):
        assert "The IMU is logged at 20 Hz. Log it faster." in words


def test_the_answer_does_not_hide_what_the_health_table_says(tmp_path: Path) -> None:
    problems = (rejected("gnss_pos", 0.3, 22.0, 30.0), rejected("baro_hgt", 0.02, 24.0, 25.0, "warning"))
    page = page_of(write_documents(tmp_path / "analyze" / "both", (LATE,), health_rows(*problems)))
    head = told(page[: page.index("<h2>Why")])
    assert "2 figures of sensors and filter lie beyond the limit, 1 far beyond it" in head
    # the limit of a share has the unit of the words beside it
    assert "samples rejected: 30 % 1 %" in told(page)


def test_what_is_usual_has_the_form_of_the_words(tmp_path: Path) -> None:
    signs = (
        Sign("readings scatter by 92% of the field", 0.919, 0.25, "1"),
        Sign("the field is 2.09 times as strong as there", 1.09, 0.25, "1"),
        Sign("EKF2_GYR_NOISE is 0.1, the most that PX4 takes", 2.0, 1.0, ""),
    )
    told_page = told(page_of(write_documents(tmp_path / "analyze" / "field", (replace(SHAKEN, signs=signs),))))
    assert "readings scatter by 92 % of the field (usual: up to 25 %)" in told_page
    # of a figure that the words do not tell the usual one would only confuse
    assert "2.09 times as strong as there (usual" not in told_page
    # nor is the 2 of a name a figure
    assert "the most that PX4 takes (usual" not in told_page


def test_measured_values_have_words_and_units(tmp_path: Path) -> None:
    values = {
        "worst_pdop": float("nan"),
        "EKF2_ACC_NOISE": 0.5,
        "imu_shaking_m_s2": 12.966,
        "clipped_share": 0.0048,
        "vision_turn_deg": 90.0,
    }
    words = told(page_of(write_documents(tmp_path / "analyze" / "values", (replace(SHAKEN, values=values),))))
    assert "Values to set EKF2_ACC_NOISE = 0.5 Measured IMU shaking: 12.97 m/s²" in words
    assert "clipped share: 0.48 %" in words
    assert "vision turn: 90°" in words
    # what is not known is null in the document, which any JSON reader takes, and not told
    assert "NaN" not in (tmp_path / "analyze" / "values" / "diagnosis.json").read_text(encoding="utf-8")
    assert "worst" not in words


def test_figures_that_no_cause_explains_are_told_as_such(tmp_path: Path) -> None:
    problems = (rejected("baro_hgt", 0.02, 24.0, 25.0, "warning"), rejected("gnss_pos", 0.3, 22.0, 30.0))
    folder = write_documents(tmp_path / "analyze" / "odd", rows=health_rows(*problems))
    words = told(page_of(folder))
    assert "Something is off, and no known cause explains it" in words
    assert words.index("gnss_pos: samples rejected: 30 %") < words.index("baro_hgt: samples rejected: 2 %")


def test_the_same_figure_of_several_instances_is_one_line(tmp_path: Path) -> None:
    problems = (rejected("mag", 0.3, 22.0, 30.0), rejected("mag", 0.2, 22.0, 30.0, "warning"))
    page = page_of(write_documents(tmp_path / "analyze" / "twice", rows=health_rows(*problems)))
    table = page[page.index("Health of sensors") : page.index("<details>", page.index("Health of sensors"))]
    assert table.count("samples rejected") == 1
    assert "beyond it on instance 1, too" in table


def test_the_page_is_of_the_same_bytes_twice(tmp_path: Path) -> None:
    folder = write_documents(tmp_path / "analyze" / "flight", (SHAKEN,))
    assert page_of(folder, b"blob") == page_of(folder, b"blob")


def test_a_document_that_is_lost_or_of_something_else_is_named(tmp_path: Path) -> None:
    folder = write_documents(tmp_path / "analyze" / "flight")
    write_document(folder / "effects.json", {"flight": "flight"})
    with pytest.raises(UserError, match=r"effects\.json.*effects"):
        page_of(folder)
    (folder / "diagnosis.json").unlink()
    with pytest.raises(UserError, match=r"diagnosis\.json"):
        page_of(folder)
