"""Allan deviations of the sensors that stood still, with intervals and what was fitted."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from fusetune.analyze.sensor_noise.allan import AllanCurve
from fusetune.analyze.sensor_noise.allan_fit import AllanFigures, freedom_of_mixture, interval
from fusetune.analyze.sensor_noise.allan_model import FLAT
from fusetune.analyze.sensor_noise.pooled import PooledSensor
from fusetune.analyze.sensor_noise.sensor_noise import SensorNoise
from fusetune.analyze.sensor_noise.sensor_series import Sensor
from fusetune.report.figures.drawing import empty_figure, new_figure
from fusetune.report.sensor_shapes import allan_words

MEASURED_COLOUR, FITTED_COLOUR = "#0072B2", "#D55E00"
_COLUMNS = 3
NOT_STILL = (
    "Nowhere in this log does the vehicle stand still for three seconds: the noise at rest is not known.\n"
    "A log from boot on (SDLOG_MODE 2), with the vehicle left alone before arming, tells it."
)


def draw_allan(noise: SensorNoise, columns: int = _COLUMNS) -> Figure:
    """Of one flight, so many panels side by side."""
    return _draw([(one.sensor, one.curve, one.figures) for one in noise.sensors.values()], columns)


def draw_pooled_allan(pooled: tuple[PooledSensor, ...]) -> Figure:
    """Of several flights of one vehicle."""
    return _draw([(one.sensor, one.curve, one.figures) for one in pooled if one.curve and one.figures])


def _draw(found: list[tuple[Sensor, AllanCurve, AllanFigures]], most: int = _COLUMNS) -> Figure:
    shown = [one for one in found if len(one[1].factors)]
    if not shown:
        return empty_figure(NOT_STILL)
    columns = min(most, len(shown))
    rows = -(-len(shown) // columns)
    width, height = 3.6 * columns, 3.2 * rows
    figure = new_figure(width, height, layout=None)
    figure.subplots_adjust(
        left=0.75 / width,
        right=1.0 - 0.1 / width,
        top=1.0 - 0.25 / height,
        bottom=0.45 / height,
        wspace=0.3,
        hspace=0.32,
    )
    for place, (sensor, curve, figures) in enumerate(shown):
        _curve(figure.add_subplot(rows, columns, place + 1), sensor, curve, figures)
    return figure


def _curve(axes: Axes, sensor: Sensor, curve: AllanCurve, figures: AllanFigures) -> None:
    tau = curve.tau_s
    low, high = interval(curve.deviation, freedom_of_mixture(curve, figures))
    axes.fill_between(tau, low, high, color=MEASURED_COLOUR, alpha=0.2, linewidth=0.0, label="95 % interval")
    axes.plot(tau, curve.deviation, "o-", color=MEASURED_COLOUR, markersize=3.0, linewidth=0.9, label="measured")
    if figures.noise_density.value is not None:
        fitted = np.geomspace(figures.from_s, tau[-1], 60)
        axes.plot(fitted, figures.deviation(fitted), color=FITTED_COLOUR, linewidth=1.2, label="fitted")
    if figures.bias_instability.value is not None:
        axes.axhline(figures.bias_instability.value * np.sqrt(FLAT), color="#666666", linewidth=0.7, linestyle=":")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("averaging time τ [s]")
    axes.set_ylabel(f"Allan deviation [{sensor.unit}]")
    axes.set_title(f"{sensor.label}, longest {curve.longest_s:.0f} s")
    axes.text(
        0.04,
        0.04,
        "\n".join(allan_words(sensor, figures)),
        ha="left",
        va="bottom",
        fontsize=6.5,
        transform=axes.transAxes,
    )
    axes.legend(loc="upper right", fontsize=7)
