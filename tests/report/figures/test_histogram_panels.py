"""Histograms as SVG: what stands where."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

from fusetune.report.figures.histogram_panels import HistogramPanel, histograms_svg

SVG = "{http://www.w3.org/2000/svg}"


def test_bars_lines_and_labels_stand_on_one_scale() -> None:
    panel = HistogramPanel("coning <mean> [rad²]", (0.0, 1e-6, 2e-6), (3, 1), (0.0, 1.5e-6), 5e-7, 2e-6, "4 flights")
    group = ET.fromstring(histograms_svg([panel, panel])).findall(f"{SVG}g")[1]
    bars = [one for one in group.iter(f"{SVG}rect") if one.get("class") == "bar"]
    # three times as high, as wide, one beginning where the other ends
    heights = [float(one.attrib["height"]) for one in bars]
    assert heights[0] == pytest.approx(3.0 * heights[1], abs=0.3)
    edges = [float(one.attrib["x"]) for one in bars]
    width = float(bars[0].attrib["width"])
    assert edges[1] == pytest.approx(edges[0] + width, abs=0.2)
    lines = {one.attrib["class"]: float(one.attrib["x1"]) for one in group.iter(f"{SVG}line")}
    assert lines["median"] == pytest.approx(edges[0] + 0.5 * width, abs=0.2)
    assert lines["limit"] == pytest.approx(edges[1] + width, abs=0.2)
    texts = {one.text: float(one.attrib["x"]) for one in group.iter(f"{SVG}text")}
    assert texts["6·10⁻⁷"] == pytest.approx(edges[0] + 0.6 * width, abs=0.2)
    assert {"coning <mean> [rad²]", "4 flights"} <= texts.keys()
