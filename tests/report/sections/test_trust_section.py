"""The section on trust: one row per flight, from the files that the analyze room writes."""

import re
from pathlib import Path
from typing import Any

from fusetune.analyze.trust.grade_causes import cause
from fusetune.finding import Finding
from fusetune.report.sections.trust_section import read_trust, trust_section
from fusetune.save.checks.gnss import gnss
from fusetune.save.checks.magnetometer import magnetometer
from fusetune.storage.documents import write_document

NOTHING: dict[str, Any] = {
    "innovation_ratio": {}, "velocity_m_s": None, "heading_deg": None, "height_m": None, "vertical_velocity_m_s": None,
    "flags_equal": None, "height_flags_equal": None, "resets": {},
}  # fmt: skip
LATE = Finding("log_start", "warning", "the log starts late", "wait longer")
TRUST: dict[str, Any] = {
    "grade": "B",
    "as_logged_grade": "D",
    "words": "The replay follows closely.",
    "reason": "GNSS logged at 2.0 Hz",
    "start": "warm: the log begins 2 s before take-off",
    "as_logged": NOTHING
    | {"innovation_ratio": {"heading": 3.0}, "velocity_m_s": 0.5, "heading_deg": 9.0, "flags_equal": 0.5}
    | {"resets": {"height": [144, 0], "vertical velocity": [1, 1]}},
    "repaired": NOTHING
    | {"innovation_ratio": {"heading": 1.1}, "velocity_m_s": 0.1, "heading_deg": 1.0, "flags_equal": 0.99}
    | {"height_m": 0.25, "resets": {"height": [1, 0], "vertical velocity": [1, 1]}},
    "figure_grades": {"innovation_factor": "A", "velocity_m_s": "B", "heading_deg": "A", "flags_equal": "A"},
    "causes": [
        cause(magnetometer, "thinned magnetometer", 2.0, repaired=True, measured=True).document(),
        cause(gnss, "GNSS logged at 2.0 Hz", 0.4, repaired=False, measured=True).document(),
    ],
}


def write(folder: Path, name: str, **changes: Any) -> Path:
    content = {"flight": name, "reasons": [LATE.document()], "median_relative_rms": None, "axes": []} | changes
    target = folder / name
    target.mkdir()
    write_document(target / "fidelity.json", content)
    return target


def test_a_graded_flight_says_what_was_repaired_and_what_remains(tmp_path: Path) -> None:
    html = trust_section(read_trust([write(tmp_path, "first", trust=TRUST)]))
    table = html[: html.index("Figures of each flight")]
    for text in ("first", ">B<", ">D<", "thinned magnetometer", "GNSS logged at 2.0 Hz"):
        assert text in table
    # What held only of the log as it is stands behind the click.
    assert "the log starts late" not in table
    assert "As logged: the log starts late (wait longer)." in html
    assert "warm: the log begins 2 s before take-off" in html


def test_height_and_what_was_not_compared_stand_in_the_table(tmp_path: Path) -> None:
    html = trust_section(read_trust([write(tmp_path, "first", trust=TRUST)]))
    rows = dict(re.findall(r"<tr><td[^>]*>([^<]*)</td>(.*?)</tr>", html))
    assert re.findall(r">([^<]+)</td>", rows["resets of height, more or fewer"])[:2] == ["144", "1"]
    height = re.findall(r">([^<]+)</td>", rows["height less its mean, RMS difference, m"])
    assert height[:2] == ["not compared", "0.25"]
    assert rows["vertical velocity, RMS difference, m/s"].count("not compared") == 3


def test_a_flight_with_nothing_to_compare_says_so(tmp_path: Path) -> None:
    changes = {"grade": "D", "reason": "nothing to compare", "figure_grades": {}, "causes": []}
    trust = TRUST | changes | {"as_logged": NOTHING, "repaired": NOTHING}
    html = trust_section(read_trust([write(tmp_path, "second", trust=trust)]))
    table = html[: html.index("Figures of each flight")]
    assert ">D<" in table
    assert "nothing to compare" in table


def test_nothing_compared_is_no_section(tmp_path: Path) -> None:
    assert trust_section(read_trust([tmp_path])) == ""
