"""The form that all rooms share: what is written is what is read."""

from __future__ import annotations

import json

import pyarrow as pa
from hypothesis import given
from hypothesis import strategies as st

from fusetune.finding import Finding, documents, from_documents, of_severity

TEXTS = st.text(max_size=20)
NUMBERS = st.floats(allow_nan=False)
TIMES = st.none() | st.integers(0, 2**62)
FINDINGS = st.builds(
    Finding,
    TEXTS,
    st.sampled_from(["does-not-apply", "pass", "note", "warning", "fail"]),
    TEXTS,
    TEXTS,
    st.none() | NUMBERS,
    st.none() | NUMBERS,
    TEXTS,
    TIMES,
    TIMES,
    st.dictionaries(TEXTS, st.booleans() | st.integers() | NUMBERS | TEXTS, max_size=3),
)


@given(st.lists(FINDINGS, max_size=4))
def test_findings_come_back_from_json(findings: list[Finding]) -> None:
    assert from_documents(json.loads(json.dumps(documents(findings)))) == tuple(findings)


def test_a_table_may_hold_a_part_of_a_finding() -> None:
    """Columns that a table leaves out are empty; the order of the columns does not matter, and nothing is nothing."""
    kept = pa.struct([("found", pa.string()), ("id", pa.string()), ("severity", pa.string())])
    whole = Finding("imu_gaps", "warning", "a gap", "Use a faster card", 0.5, 0.1, "s", 3, 4, {"gaps": 1})
    row = pa.array([documents([whole])], pa.list_(kept)).to_pylist()[0]
    assert from_documents(row) == (Finding("imu_gaps", "warning", "a gap"),)
    assert from_documents(None) == ()


def test_findings_with_evidence_can_be_told_apart_and_collected() -> None:
    one, other = (Finding("gnss", "note", "a jump", start_us=1, evidence={"jump_m": size}) for size in (2.0, 3.0))
    assert one != other
    assert len({one, other, one}) == 2


def test_the_remedy_stands_in_brackets_where_there_is_one() -> None:
    assert Finding("gnss", "warning", "2 Hz", "Log more").in_words == "2 Hz (Log more)"
    assert Finding("gnss", "pass", "5 Hz").in_words == "5 Hz"


def test_those_of_one_severity_keep_their_order() -> None:
    findings = [Finding(name, severity, name) for name, severity in (("a", "fail"), ("b", "pass"), ("c", "fail"))]
    assert [finding.id for finding in of_severity(findings, "fail")] == ["a", "c"]
