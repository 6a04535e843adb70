"""The table of all logs: groups, order, what is told of each."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
from tests.apply.fleet.made_fleet import found, made_diagnosis
from tests.report.read_page import told

from fusetune.report.results import Results, read_results
from fusetune.report.sections.flights_section import Logs, flights_section, single_flights_section

VERDICTS = [
    {
        "flight": "new",
        "recorded": "2026-02-01T10:11:12Z",
        "airborne_s": 61.3,
        "vehicle": "one",
        "firmware": "v1.15.4",
        "replayed_as": "v1.16",
    },
    {"flight": "old", "recorded": "2026-01-01T10:11:12Z", "airborne_s": 30.0, "vehicle": "one", "firmware": "v1.16.0"},
    {"flight": "other", "recorded": "", "airborne_s": None, "vehicle": "<two>", "firmware": None},
    {"flight": "bad", "recorded": "", "airborne_s": None, "reason": "the log is <empty>"},
]


def results(**other: Any) -> Any:
    per_flight = pd.DataFrame(
        [("old", "present", 0.0), ("old", "b", -0.1), ("new", "present", 0.0), ("new", "b", 0.2)],
        columns=["flight", "set", "score"],
    )
    decision = {
        "status": "keep", "chosen": "present", "best_candidate": "b",
        "vehicle": {"left_out": {"other": "<two>"}},
    }  # fmt: skip
    made = {
        "flights": ("old", "new"), "scored": ("old", "new"), "scoring": {"old": {}, "new": {}, "other": {}},
        "per_flight": per_flight, "shown": ("present", "b"), "present": "present", "decision": decision,
    }  # fmt: skip
    return SimpleNamespace(**made | other)


def logs() -> Logs:
    diagnoses = [made_diagnosis("new", [found("vibration", "fail"), found("baro_drift", "note")])]
    trust = [{"flight": "old", "trust": {"grade": "B"}}]
    return Logs.of(VERDICTS, diagnoses, trust, ["results/report/flights/old.html"], "results/report.html")


def test_logs_stand_in_groups_each_in_order_of_time() -> None:
    section = flights_section(results(), logs(), ["new"])
    words = told(section[: section.index("<details")])
    order = ["In the decision: 2", "old", "new", "Other vehicles", "other", "Cannot be replayed: 1", "bad"]
    places = [words.index(one) for one in order]
    assert places == sorted(places)
    assert "Replayed, not in the decision" not in words, "there is nothing to say"
    shown = section[: section.index("<details")]
    rows = {re.sub("<[^>]+>", "", row.split("</td>")[0]): told(row) for row in re.split("<tr[^>]*>", shown)[1:]}
    # 100 (e^-0.1 − 1) and 100 (e^0.2 − 1)
    assert rows["old"] == "old 2026-01-01 10:11 30 B −9.5"
    assert rows["new"] == "new 2026-02-01 10:11 61.3 – It is vibration (and 1 more) +22.1 look at new"
    assert "the log is &lt;empty&gt;" in rows["bad"]
    assert '<a href="report/flights/old.html">old</a>' in section
    assert '<a href="#viewer" data-state="flight=new">' in section


def test_whole_names_vehicles_and_firmware_are_behind_a_click() -> None:
    section = flights_section(results(), logs())
    listed = section[section.index("<details") :]
    assert 'class="whole"' in listed
    assert "new one v1.15.4 v1.16" in told(listed)
    assert "other &lt;two&gt; unknown –" in told(listed)


def test_without_another_set_no_change_is_told() -> None:
    kept = results().decision | {"best_candidate": None}
    section = flights_section(results(decision=kept), logs())
    assert "below 0 is better" not in section


def test_what_befell_the_sets_is_one_table(made: tuple[Path, str]) -> None:
    root, _ = made
    read: Results = read_results([root / "analyze" / f"flight_{i}" for i in range(5)], root / "apply")
    words = told(single_flights_section(read))
    assert "What befell the sets: 5 cases" in words
    assert "flight_3 &lt;restless&gt; 2, 2 of them far" in words
