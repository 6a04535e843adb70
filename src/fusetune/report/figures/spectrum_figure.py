"""Spectra at rest and in flight, with the tones that stand out."""

from __future__ import annotations

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fusetune.analyze.sensor_noise.sensor_character import SensorCharacter
from fusetune.analyze.sensor_noise.sensor_noise import SensorNoise
from fusetune.analyze.sensor_noise.spectrum import LOWEST_TONE_HZ
from fusetune.report.figures.drawing import empty_figure, new_figure
from fusetune.report.figures.sensor_figures import FLIGHT_COLOUR, REST_COLOUR
from fusetune.report.sensor_shapes import tone_words, vibration_title

_MOST_TONES = 4
_TITLE_WIDTH = 34


def draw_spectra(noise: SensorNoise) -> Figure:
    """Of gyro, accelerometer and magnetometer of one flight."""
    shown = [one for one in noise.sensors.values() if one.rest_spectrum or one.flight_spectrum]
    if not shown:
        return empty_figure("The log holds too few samples in a row for a spectrum.")
    width, height = 3.6 * len(shown), 3.4
    figure = new_figure(width, height, layout=None)
    figure.subplots_adjust(
        left=0.7 / width, right=1.0 - 0.1 / width, top=1.0 - 0.25 / height, bottom=0.45 / height, wspace=0.28
    )
    for place, character in enumerate(shown):
        _spectrum(figure.add_subplot(1, len(shown), place + 1), character)
    return figure


def _spectrum(axes: Axes, character: SensorCharacter) -> None:
    unit = character.sensor.unit
    for found, colour, label in (
        (character.rest_spectrum, REST_COLOUR, "at rest"),
        (character.flight_spectrum, FLIGHT_COLOUR, "in flight"),
    ):
        if found is not None:
            axes.plot(found.frequency_hz, np.sqrt(found.total), color=colour, linewidth=0.9, label=label)
    vibration, flight = character.vibration, character.flight_spectrum
    if vibration is not None and flight is not None:
        level = np.sqrt(flight.total)
        for one in vibration.tones.listed[:_MOST_TONES]:
            place = int(np.argmin(np.abs(flight.frequency_hz - one.tone.frequency_hz)))
            around = level[max(place - 3, 0) : place + 4].max()
            axes.annotate(
                "\n".join(tone_words(one)),
                (one.tone.frequency_hz, around),
                xytext=(0, 6),
                textcoords="offset points",
                ha="center",
                va="bottom",
                fontsize=6.5,
            )
        moved = min(LOWEST_TONE_HZ, float(flight.frequency_hz[-1]))
        axes.axvspan(float(flight.frequency_hz[0]), moved, color="#DDDDDD", alpha=0.5, linewidth=0.0)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.margins(y=0.15)
    axes.set_xlabel("frequency [Hz] (grey: motion)")
    axes.set_ylabel(f"density, axes together [{unit}/√Hz]")
    axes.set_title(textwrap.fill(vibration_title(character), _TITLE_WIDTH, break_on_hyphens=False))
    axes.legend(loc="lower left", fontsize=7)
