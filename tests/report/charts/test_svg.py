"""What charts are drawn with: places, ticks, words that fit, shapes; figures by hand."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.report.charts.svg.elements import area, crosses, dots, hinted, path_steps, svg, text
from fusetune.report.charts.svg.legend import Entry, legend, marker_symbol
from fusetune.report.charts.svg.markers import marker
from fusetune.report.charts.svg.rows import rows_of
from fusetune.report.charts.svg.scales import Linear, Log, figure, percent, round_values, signed_figure
from fusetune.report.charts.svg.text_width import fitted_names, text_width
from fusetune.report.set_styles import MARKERS

NAMESPACE = "{http://www.w3.org/2000/svg}"


def test_places_on_linear_and_logarithmic_axes() -> None:
    # a quarter of the way from 0 to 8, upwards
    assert Linear(0.0, 8.0, 100.0, 20.0).at(2.0) == pytest.approx(80.0)
    # two of four decades
    assert Log(0.01, 100.0, 0.0, 200.0).at(1.0) == pytest.approx(100.0)
    places = Log(0.01, 100.0, 0.0, 200.0)([0.1, 0.0, -1.0])
    assert places[0] == pytest.approx(50.0)
    assert np.isnan(places[1:]).all()


def test_ticks_are_round_and_few() -> None:
    assert Linear(-53.0, 4.0, 0.0, 1.0).ticks(4) == [-40.0, -20.0, 0.0]
    assert Linear(0.4, 6.6, 0.0, 1.0).ticks(5, whole=True) == [2.0, 4.0, 6.0]
    assert Log(0.012, 130.0, 0.0, 1.0).ticks(5) == pytest.approx([0.1, 1.0, 10.0, 100.0])
    assert Log(0.9, 6.0, 0.0, 1.0).ticks(5) == pytest.approx([1.0, 2.0, 5.0])


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 9))
def test_round_values_lie_on_the_axis(low: float, span: float, most: int) -> None:
    """Whatever the axis, there are no more than asked for, all within it, equally far apart."""
    high = low + span
    found = round_values(low, high, most)
    slack = 1e-6 * (span + abs(low))
    assert len(found) <= most
    assert all(low - slack <= one <= high + slack for one in found)
    if len(found) > 2:
        assert np.ptp(np.diff(found)) <= slack


def test_figures_are_written_as_in_print() -> None:
    assert [figure(one) for one in (0.0, -0.25, 1e-4, 3.5e-6, 120000.0)] == [
        "0",
        "−0.25",
        "10⁻⁴",
        "3.5·10⁻⁶",
        "1.2·10⁵",
    ]
    assert signed_figure(20.0) == "+20"
    assert percent(-3.04) == "−3.0 %"


def test_names_that_are_cut_still_differ() -> None:
    names = [f"paper{number}+delay_mended" for number in range(1, 7)]
    short = fitted_names(tuple(names), 90.0)
    assert len(set(short)) == 6
    assert all("…" in one and text_width(one) <= 90.0 for one in short)
    assert fitted_names(("short",), 90.0) == ["short"]
    # DejaVu Sans: 0.59 em of a y, at 10 units to the em
    assert text_width("yy", 10.0) == pytest.approx(11.8)


def test_a_path_has_gaps_and_no_point_twice() -> None:
    # the third is a gap, the fourth begins anew, the fifth falls onto it at a tenth of a pixel
    assert path_steps([0.0, 1.04, math.nan, 3.0, 3.04], [0.0, 2.0, 0.0, 4.0, 4.0]) == "M0 0L1 2M3 4"
    assert area([0.0, 10.0], [5.0, 5.0], [1.0, 2.0], "band") == '<path class="band" d="M0 5L10 5L10 2L0 1Z"/>'
    assert dots([1.0, 1.0], [2.0, 2.0], 1.0, "dot") == '<path class="dot" d="M0 2a1 1 0 1 0 2 0a1 1 0 1 0 -2 0"/>'
    assert crosses([5.0], [5.0], 2.0, "thin") == '<path class="thin" d="M3 3l4 4m0-4l-4 4"/>'


@pytest.mark.parametrize("shape", MARKERS)
def test_every_marker_lies_around_its_place(shape: str) -> None:
    drawn = ElementTree.fromstring(marker(shape, 50.0, 20.0, 4.0, hollow=True))
    assert drawn.get("class") == "hollow"
    if shape == "circle":
        assert (drawn.get("cx"), drawn.get("cy"), drawn.get("r")) == ("50", "20", "4")
        return
    corners = np.array([[float(one) for one in pair.split()] for pair in str(drawn.get("d"))[1:-1].split("L")])
    assert np.abs(corners - [50.0, 20.0]).max() <= 1.3 * 4.0 + 0.1
    assert corners.min(axis=0) == pytest.approx([50.0 - 4.2, 20.0 - 4.2], abs=1.2)


HOSTILE = '<script>alert(1)</script>" onload="x\' & </svg>'


def test_hostile_names_are_words_and_nothing_else() -> None:
    rows = rows_of([HOSTILE, "x" * 90], 0.0, 20.0)
    key, _ = legend([Entry(marker_symbol("set-2", "star"), HOSTILE)], 50.0)
    parts = [rows.labels(), key, hinted(HOSTILE, text(0.0, 0.0, HOSTILE))]
    drawn = svg("one", HOSTILE, HOSTILE, 320.0, 100.0, parts, "")
    root = ElementTree.fromstring(drawn)
    allowed = {"svg", "g", "text", "title", "desc", "path"}
    assert {one.tag.removeprefix(NAMESPACE) for one in root.iter()} == allowed
    assert not any(name.startswith("on") or name == "style" for one in root.iter() for name in one.attrib)
    assert root.findtext(f"{NAMESPACE}title") == HOSTILE
    assert root.findtext(f"{NAMESPACE}desc") == HOSTILE
    # told of by the title and the description that it holds
    told = str(root.get("aria-labelledby")).split()
    assert told == [root.find(f"{NAMESPACE}{tag}").get("id") for tag in ("title", "desc")]  # type: ignore[union-attr]
