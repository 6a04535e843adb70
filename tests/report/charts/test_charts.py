"""Every chart of the pages on made results: well-formed, the same every time, and with marks where they belong."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from tests.report.made_search import made_search

from fusetune.apply.evidence import AIDED
from fusetune.report.change_cells import cell_words
from fusetune.report.charts.differences import answer_chart, differences_chart
from fusetune.report.charts.drift import drift_chart
from fusetune.report.charts.flights_by_sets import flights_by_sets_chart
from fusetune.report.charts.innovations import (
    breaks_chart,
    consistency_chart,
    innovations_chart,
    normalised_innovations_chart,
    rms_chart,
)
from fusetune.report.charts.pareto import pareto_chart
from fusetune.report.charts.power import power_chart
from fusetune.report.charts.search import found_chart, found_pareto_chart, kept_aside_chart, shrinkage_chart
from fusetune.report.charts.sensitivity import sensitivity_chart
from fusetune.report.comparison import SCORE, aim_changes, flight_changes
from fusetune.report.results import Results, pooled_samples, read_results

SVG = "{http://www.w3.org/2000/svg}"
POWER = {
    "flights": 4,
    "minutes": 1.0,
    "next_minutes": 3.0,
    "chance_asked_for": 0.8,
    "curves": [
        {"gain_percent": 10.0, "times_longer": 1.0, "flights": [2, 7, 12], "chance": [0.2, 0.5, 0.9]},
        {"gain_percent": 10.0, "times_longer": 3.0, "flights": [2, 7, 12], "chance": [0.3, 0.6, 1.0]},
    ],
}


@pytest.fixture(scope="module")
def results(made: tuple[Path, str]) -> Results:
    root, _ = made
    found = read_results([root / "analyze" / f"flight_{i}" for i in range(5)], root / "apply")
    return dataclasses.replace(found, decision=found.decision | {"power": POWER})


def charts_of(html: str) -> list[ElementTree.Element]:
    """The charts in a piece of a page; every one is told of, and acts on nothing."""
    assert " style=" not in html
    assert not re.search(r"<[^>]*\son[a-z]+=", html)
    found = [ElementTree.fromstring(one) for one in re.findall(r"<svg .*?</svg>", html, flags=re.S)]
    ids = [one.get("id") for chart in found for one in chart.iter() if one.get("id")]
    assert len(set(ids)) == len(ids)
    for chart in found:
        assert chart.get("role") == "img"
        assert chart.findtext(f"{SVG}title")
        assert chart.findtext(f"{SVG}desc")
        numbers = [float(one) for one in str(chart.get("viewBox")).split()]
        assert numbers[:2] == [0.0, 0.0]
        assert "nan" not in ElementTree.tostring(chart, encoding="unicode").lower().replace("nanosecond", "")
    return found


def rows_of(chart: ElementTree.Element, kind: str) -> list[ElementTree.Element]:
    return [one for one in chart.iter() if kind in str(one.get("class")).split()]


ALL: list[tuple[str, Callable[[Results], str]]] = [
    ("answer", answer_chart),
    ("differences", differences_chart),
    ("flights_by_sets", flights_by_sets_chart),
    ("pareto", pareto_chart),
    ("drift", drift_chart),
    ("power", power_chart),
    ("sensitivity", lambda results: sensitivity_chart(results.sensitivity.found)),
    ("rms", rms_chart),
    ("consistency", consistency_chart),
    ("breaks", breaks_chart),
    ("innovations", lambda results: innovations_chart(results, pooled_samples(results))),
    ("normalised", lambda results: normalised_innovations_chart(results, pooled_samples(results))),
]


@pytest.mark.parametrize(("name", "draw"), ALL, ids=[name for name, _ in ALL])
def test_charts_are_well_formed_and_the_same_every_time(
    results: Results, name: str, draw: Callable[[Results], str]
) -> None:
    """One of the made sets is called <restless>."""
    html = draw(results)
    assert charts_of(html) or name == "sensitivity"
    assert draw(results) == html
    assert "<restless>" not in html


def test_without_anything_to_compare_nothing_is_drawn(results: Results) -> None:
    alone = dataclasses.replace(
        results,
        ranking=results.ranking[results.ranking["name"] == results.present],
        per_flight=results.per_flight[results.per_flight["set"] == results.present],
        shown=(results.present,),
        decision=results.decision | {"power": None, "best_candidate": None, "chosen": results.present},
    )
    for draw in (answer_chart, differences_chart, flights_by_sets_chart, pareto_chart, power_chart, rms_chart):
        assert draw(alone) == ""
    assert sensitivity_chart(None) == ""


def test_an_interval_lies_where_its_figures_say(results: Results) -> None:
    """The bar and the mark of a set on the axis: two ticks tell pixels per percent."""
    chart = charts_of(differences_chart(results))[0]
    ticks = {one.text: float(str(one.get("x"))) for one in chart.iter(f"{SVG}text") if one.get("class") == "tick"}
    values = {float(text.replace("−", "-")): x for text, x in ticks.items() if text}
    # the outermost word may be moved so that it is not cut
    (v1, x1), (v2, x2) = sorted(values.items())[:2]
    per_percent = (x2 - x1) / (v2 - v1)
    change = aim_changes(results, SCORE).loc["better"]
    group = next(one for one in chart.iter(f"{SVG}g") if str(one.findtext(f"{SVG}title")).startswith("better: "))
    bar = group.find(f"{SVG}line")
    assert bar is not None
    ends = [float(str(bar.get(name))) for name in ("x1", "x2")]
    expected = [x1 + (float(change[name]) - v1) * per_percent for name in ("lower", "upper")]
    assert ends == pytest.approx(expected, abs=0.2)
    assert f"{float(change['change']):+.1f} %".replace("-", "−") in str(group.findtext(f"{SVG}title"))


def test_a_chance_lies_where_its_figures_say(results: Results) -> None:
    """7 flights of an axis from 1.5 to 12.5 between 34 and 310, 50 % of one from 0 to 100 between 188 and 38: the
    place is 172, 113, and the corner of a triangle of 3.2 lies 1.15 times that above."""
    (chart,) = charts_of(power_chart(results))
    marks = [one for one in chart.iter(f"{SVG}path") if one.get("class") == "mark"]
    assert str(marks[1].get("d")).startswith("M172 109.3L")
    assert "takes 12 flights" in str(chart.findtext(f"{SVG}desc"))


def test_a_cell_for_each_flight_and_set_with_its_sign(results: Results) -> None:
    (chart,) = charts_of(flights_by_sets_chart(results))
    changes = flight_changes(results)
    told = [one for one in chart.iter(f"{SVG}text") if one.find(f"{SVG}title") is not None and one.text]
    cells = [one for one in told if " on flight_" in str(one.findtext(f"{SVG}title"))]
    assert [one.text for one in cells] == [cell_words(value) for value in changes.to_numpy().ravel().tolist()]
    # one colour for smaller errors, another for larger ones, and none for none
    assert [cell_words(one) for one in (-12.34, 3.21, 0.0, float("nan"))] == ["−12", "+3.2", "=", "–"]
    assert {str(one.get("class")) for one in rows_of(chart, "cell")} <= {"cell", "cell good", "cell bad"}


def test_a_set_looks_alike_in_every_chart(results: Results) -> None:
    kind = f"set-{results.styles['better'].index}"
    for draw in (differences_chart, pareto_chart, drift_chart, rms_chart, consistency_chart):
        groups = [one for chart in charts_of(draw(results)) for one in rows_of(chart, kind)]
        assert groups, draw.__name__
    assert results.styles[results.present].index == 0


def test_of_many_flights_marks_are_joined(results: Results) -> None:
    """25 flights of 4 sets: what is drawn of the consistency does not grow with a hint for each."""
    metrics = results.metrics
    many = [metrics.assign(flight=pd.Categorical(metrics["flight"].astype(str) + f"_{copy}")) for copy in range(5)]
    joined = dataclasses.replace(results, metrics=pd.concat(many, ignore_index=True))
    few, grown = len(consistency_chart(results)), len(consistency_chart(joined))
    assert grown < 1.5 * few
    charts_of(consistency_chart(joined))


def test_the_answer_tells_all_aims_in_words(results: Results) -> None:
    (chart,) = charts_of(answer_chart(results))
    said = str(chart.findtext(f"{SVG}desc"))
    shown = flight_changes(results, f"{AIDED}_score")
    name = next(str(one) for one in ("better",) if one in shown)
    smaller = int(np.count_nonzero(shown[name] < 0.0))
    assert f"smaller on {smaller} of 5 flights" in said
    assert said.startswith("all together −")


def searches() -> list[tuple[str, Any]]:
    return [("kept_aside", kept_aside_chart), ("shrinkage", shrinkage_chart), ("found", found_chart),
            ("pareto", found_pareto_chart)]  # fmt: skip


def test_of_a_search_a_gain_is_a_change_to_smaller_errors() -> None:
    """Gains of 6, −2, 5 and 7 % of the made search are changes of −6, +2, −5 and −7 %."""
    found = made_search()
    for _, draw in searches():
        charts_of(draw(found))
    (chart,) = charts_of(kept_aside_chart(found))
    hints = [one.text for one in chart.iter(f"{SVG}title")]
    assert [one for one in hints if one and re.match("[abcd]: ", one)] == [
        "a: −6.0 %", "b: +2.0 %", "c: −5.0 %", "d: −7.0 %"
    ]  # fmt: skip
    assert "Better on 3 of 4 flights that the search did not see; expect −4.0&nbsp;%" in kept_aside_chart(found)
    assert "50&nbsp;% of the gain was luck: −8.0&nbsp;% on the flights searched on" in shrinkage_chart(found)
    single = made_search(searches=[], kept_aside={}, expected_gain=None)
    assert kept_aside_chart(single) == shrinkage_chart(single) == ""
