"""All figures that compare the sets over all flights."""

from collections.abc import Callable
from functools import cache

from matplotlib.figure import Figure

from fusetune.report.figures.difference_figures import differences, flights_by_sets, pareto
from fusetune.report.figures.innovation_figures import boxes, breaks, consistency, rms_by_variable
from fusetune.report.figures.power_figure import power_figure
from fusetune.report.figures.sensitivity_figure import sensitivity_figure
from fusetune.report.figures.unaided_figures import drift_figure
from fusetune.report.results import Results, pooled_samples


def summary_drawings(results: Results) -> dict[str, Callable[[], Figure]]:
    """How each is drawn, by its name."""
    pooled = cache(lambda: pooled_samples(results))
    return {
        "differences": lambda: differences(results),
        "flights_by_sets": lambda: flights_by_sets(results),
        "pareto": lambda: pareto(results),
        "drift": lambda: drift_figure(results),
        "sensitivity": lambda: sensitivity_figure(results.sensitivity.found),
        "rms": lambda: rms_by_variable(results),
        "innovations": lambda: boxes(results, pooled(), normalised=False),
        "normalised_innovations": lambda: boxes(results, pooled(), normalised=True),
        "consistency": lambda: consistency(results),
        "breaks": lambda: breaks(results),
        "power": lambda: power_figure(results),
    }
