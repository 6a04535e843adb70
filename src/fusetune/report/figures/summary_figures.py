"""All figures that compare the sets over all flights, and the files they are kept in."""

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

from matplotlib.figure import Figure

from fusetune.report.figures.difference_figures import differences, flights_by_sets, pareto
from fusetune.report.figures.drawing import empty_figure, figure_style, save_svg
from fusetune.report.figures.innovation_figures import boxes, breaks, consistency, rms_by_variable
from fusetune.report.figures.power_figure import power_figure
from fusetune.report.figures.sensitivity_figure import sensitivity_figure
from fusetune.report.figures.unaided_figures import drift_figure
from fusetune.report.results import Results, pooled_samples, read_results
from fusetune.storage.files import AnyPath

SUMMARY_FIGURES = (
    "differences.svg",
    "flights_by_sets.svg",
    "pareto.svg",
    "drift.svg",
    "sensitivity.svg",
    "rms.svg",
    "innovations.svg",
    "normalised_innovations.svg",
    "consistency.svg",
    "breaks.svg",
    "power.svg",
)
"""Files that `plot_summary` writes."""


def plot_summary(analyze_folders: Sequence[AnyPath], apply_folder: AnyPath, figure_folder: AnyPath) -> None:
    """Draw `SUMMARY_FIGURES` into `figure_folder`.

    Parameters
    ----------
    analyze_folders : `results/analyze/<flight>` of all replayed flights
    apply_folder : `results/apply`
    """
    results = read_results(analyze_folders, apply_folder)
    drawings = summary_drawings(results)
    with figure_style():
        for name in SUMMARY_FIGURES:
            figure = drawings[name]() if results.flights else empty_figure("No flight has a say in the decision.")
            save_svg(figure, Path(figure_folder) / name)


def summary_drawings(results: Results) -> dict[str, Callable[[], Figure]]:
    """How each of `SUMMARY_FIGURES` is drawn."""
    pooled = cache(lambda: pooled_samples(results))
    return {
        "differences.svg": lambda: differences(results),
        "flights_by_sets.svg": lambda: flights_by_sets(results),
        "pareto.svg": lambda: pareto(results),
        "drift.svg": lambda: drift_figure(results),
        "sensitivity.svg": lambda: sensitivity_figure(results.sensitivity.found),
        "rms.svg": lambda: rms_by_variable(results),
        "innovations.svg": lambda: boxes(results, pooled(), normalised=False),
        "normalised_innovations.svg": lambda: boxes(results, pooled(), normalised=True),
        "consistency.svg": lambda: consistency(results),
        "breaks.svg": lambda: breaks(results),
        "power.svg": lambda: power_figure(results),
    }
