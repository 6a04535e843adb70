"""All figures of a search, and the files they are kept in."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from fusetune.report.figures.drawing import empty_figure, figure_style, save_svg
from fusetune.report.figures.found_figure import found_figure
from fusetune.report.figures.gain_figures import kept_aside_figure, shrinkage_figure
from fusetune.report.figures.pareto_figure import pareto_figure
from fusetune.report.figures.sensitivity_figure import sensitivity_figure
from fusetune.report.search_results import SearchResults
from fusetune.set_names import FOUND
from fusetune.storage.files import AnyPath

KEPT_ASIDE, SHRINKAGE, FOUND_VALUES = "search_kept_aside.svg", "search_shrinkage.svg", "search_found.svg"
SEARCH_SENSITIVITY, SEARCH_PARETO = "search_sensitivity.svg", "search_pareto.svg"
SEARCH_FIGURES = (KEPT_ASIDE, SHRINKAGE, FOUND_VALUES, SEARCH_SENSITIVITY, SEARCH_PARETO)
"""Files that `plot_search` writes."""


def plot_search(results: SearchResults, figure_folder: AnyPath) -> None:
    """Draw `SEARCH_FIGURES` into a folder."""
    drawings: dict[str, Callable[[], Figure]] = {
        KEPT_ASIDE: lambda: kept_aside_figure(results),
        SHRINKAGE: lambda: shrinkage_figure(results),
        FOUND_VALUES: lambda: found_figure(results),
        SEARCH_SENSITIVITY: lambda: sensitivity_figure(results.sensitivity.found),
        SEARCH_PARETO: lambda: _pareto(results),
    }
    with figure_style():
        for name in SEARCH_FIGURES:
            save_svg(drawings[name](), Path(figure_folder) / name)


def _pareto(results: SearchResults) -> Figure:
    if results.trials is None:
        return empty_figure("No set that was tried differs from what flies now.")
    return pareto_figure(results.trials, FOUND, "what the search found")
