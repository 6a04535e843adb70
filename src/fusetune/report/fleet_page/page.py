"""Puts the page of all flights together: one file that needs no network."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fusetune.apply.fleet.flights import OF_FLIGHT
from fusetune.report.counted import count_words
from fusetune.report.figures.drawing import figure_style, save_png
from fusetune.report.figures.fleet_figures import draw_trends, histogram_panel
from fusetune.report.figures.histogram_panels import histograms_svg
from fusetune.report.fleet_page.answer import fleet_answer
from fusetune.report.fleet_page.fleet_results import Document, FleetResults, read_fleet_results
from fusetune.report.fleet_page.matrix import matrix_section
from fusetune.report.fleet_page.statistics_sections import (
    changes_section,
    figures_section,
    histograms_section,
    outliers_section,
    pooled_sensors_section,
    verdicts_section,
)
from fusetune.report.html_page import PageHead, page_links, write_page
from fusetune.storage.files import AnyPath, atomic_path

TRENDS_FILE = "trends.png"

_MOST_TRENDS = 12
_FEWEST_FLIGHTS_DRAWN = 3
_IN_A_PICTURE = 24


def build_fleet_page(
    fleet_file: AnyPath,
    health_table: AnyPath,
    figure_folder: AnyPath,
    output: AnyPath,
    flight_pages: Sequence[AnyPath] = (),
    pages: Mapping[str, AnyPath] | None = None,
) -> None:
    """Draw the figures of a fleet and write its page as one HTML file with them inside.

    Parameters
    ----------
    fleet_file : `results/apply/fleet.json`
    health_table : `results/analyze/health.parquet`, which it was made from
    figure_folder : `results/report/fleet`, is made where it does not exist; shown is also what `plot_pooled_sensors`
        drew there
    output : `results/fleet.html`
    flight_pages : `results/report/flights/<flight>.html` of the flights that have one
    pages : words → other pages that it leads to

    Raises
    ------
    UserError
        One of the first two is missing or damaged.
    """
    folder = Path(output).parent
    links = {Path(page).stem: os.path.relpath(page, folder) for page in flight_pages}
    results = read_fleet_results(fleet_file, health_table, links)
    figures = Path(figure_folder)
    figures.mkdir(parents=True, exist_ok=True)
    trends, histograms = plot_fleet(results, figures)
    sections = (
        page_links(pages or {}, output),
        fleet_answer(results),
        matrix_section(results),
        changes_section(results, trends),
        outliers_section(results),
        verdicts_section(results),
        histograms_section(histograms),
        pooled_sensors_section(sorted(figures.glob("pooled_*.svg"))),
        figures_section(results),
    )
    vehicles = count_words(results.vehicles, "vehicle")
    origin = f"{results.product}, {count_words(len(results.flights), 'flight')} of {vehicles}"
    folder.mkdir(parents=True, exist_ok=True)
    write_page(output, PageHead("All flights", "All flights: what is wrong, and what changed", origin), sections)


def plot_fleet(results: FleetResults, figure_folder: AnyPath) -> tuple[Path, list[Path]]:
    """Draw the trends and the histograms; returns their files, of which there is none where nothing can be drawn."""
    folder = Path(figure_folder)
    trends = folder / TRENDS_FILE
    for old in (trends, *folder.glob("histograms_*.svg")):
        old.unlink(missing_ok=True)
    histograms = []
    columns = _trend_columns(results)
    if columns:
        with figure_style():
            save_png(draw_trends(results.table, columns, results.changes), trends)
    drawn = [one for one in results.figures if _is_spread(one)]
    troubled = [one for one in drawn if one["verdict"]["worst"] in ("warning", "fail")][:_IN_A_PICTURE]
    others = [one for one in drawn if one not in troubled]
    parts = [troubled, *(others[start : start + _IN_A_PICTURE] for start in range(0, len(others), _IN_A_PICTURE))]
    for place, part in enumerate(one for one in parts if one):
        histograms.append(folder / f"histograms_{place}.svg")
        with atomic_path(histograms[-1]) as temporary:
            temporary.write_text(histograms_svg([histogram_panel(one) for one in part]), encoding="utf-8")
    return trends, histograms


def _is_spread(one: Document) -> bool:
    """Whether a histogram of a figure shows anything."""
    spread = one["distribution"]
    return (
        spread is not None
        and one["limit"] is not None
        and one["group"] != OF_FLIGHT
        and spread["n"] >= _FEWEST_FLIGHTS_DRAWN
        and spread["minimum"] < spread["maximum"]
    )


def _trend_columns(results: FleetResults) -> list[int]:
    """Figures that changed, then of each subject the one that lies beyond its limit on most flights."""
    dated = np.array([bool(one.date) for one in results.table.flights], dtype=bool)
    if np.count_nonzero(dated) < _FEWEST_FLIGHTS_DRAWN:
        return []
    places = {(one.id, one.unit): place for place, one in enumerate(results.table.figures)}
    changed = [places[one["id"], one["unit"]] for one in (*results.changes, *results.drifts)]

    def beyond(one: Document) -> int:
        return int(one["verdict"]["counts"].get("fail", 0) + one["verdict"]["counts"].get("warning", 0))

    troubled = sorted((one for one in results.figures if beyond(one) and _is_spread(one)), key=beyond, reverse=True)
    worst: dict[str, int] = {}
    for one in troubled:
        worst.setdefault(one["id"].partition(".")[0], places[one["id"], one["unit"]])
    return list(dict.fromkeys([*changed, *worst.values()]))[:_MOST_TRENDS]
