"""All figures of a search."""

from __future__ import annotations

from collections.abc import Callable

from matplotlib.figure import Figure

from fusetune.report.figures.drawing import empty_figure
from fusetune.report.figures.found_figure import found_figure
from fusetune.report.figures.gain_figures import kept_aside_figure, shrinkage_figure
from fusetune.report.figures.pareto_figure import pareto_figure
from fusetune.report.figures.sensitivity_figure import sensitivity_figure
from fusetune.report.search_results import SearchResults
from fusetune.set_names import FOUND


def search_drawings(results: SearchResults) -> dict[str, Callable[[], Figure]]:
    """How each is drawn, by its name."""
    return {
        "kept_aside": lambda: kept_aside_figure(results),
        "shrinkage": lambda: shrinkage_figure(results),
        "found": lambda: found_figure(results),
        "sensitivity": lambda: sensitivity_figure(results.sensitivity.found),
        "pareto": lambda: _pareto(results),
    }


def _pareto(results: SearchResults) -> Figure:
    if results.trials is None:
        return empty_figure("No set that was tried differs from what flies now.")
    return pareto_figure(results.trials, FOUND, "what the search found")
