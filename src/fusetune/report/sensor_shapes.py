"""What charts and figures of a flight's sensors show: rows to draw, outliers, quantiles, and their words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from scipy.stats import norm

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.sensor_noise.allan import KINDS
from fusetune.analyze.sensor_noise.allan_fit import NAMES, AllanFigures
from fusetune.analyze.sensor_noise.distribution import BEYOND_3_SIGMA, Distribution, deviations, outlying, standardised
from fusetune.analyze.sensor_noise.motor_harmonics import MotorTone
from fusetune.analyze.sensor_noise.sensor_character import SensorCharacter
from fusetune.analyze.sensor_noise.sensor_noise import SensorNoise
from fusetune.analyze.sensor_noise.sensor_series import Sensor

Array = npt.NDArray[np.float64]

_UNITS: Mapping[str, str] = {"white": "/√Hz", "flicker": "", "walk": "/√s"}
_SIGNS: Mapping[str, str] = {"white": "N", "flicker": "B", "walk": "K"}
_QUANTILE_POINTS = 400


def interval_seconds(noise: SensorNoise, interval: Interval) -> tuple[float, float]:
    """Ends of an interval, s since the log began."""
    return (interval[0] - noise.start_timestamp) * 1e-6, (interval[1] - noise.start_timestamp) * 1e-6


def envelope_rows(values: Array, most: int) -> npt.NDArray[np.int64]:
    """Rows to draw of a long line: of each of its parts the smallest and the largest value, at most so many."""
    parts = most // 2
    if len(values) <= most:
        return np.arange(len(values))
    size = len(values) // parts
    folded = values[: parts * size].reshape(parts, size)
    first = np.arange(parts) * size
    return np.unique(np.concatenate([first + folded.argmin(axis=1), first + folded.argmax(axis=1)]))


def outliers(noise: SensorNoise, character: SensorCharacter) -> npt.NDArray[np.bool_]:
    """(N, axes): at rest and in flight each by its own spread."""
    series = character.series
    found = np.zeros(series.values.shape, np.bool_)
    for intervals in (noise.still, noise.airborne):
        rows = np.flatnonzero(series.inside(intervals))
        if len(rows):
            found[rows] = outlying(deviations(series.values[rows]))
    return found


def standardised_deviations(character: SensorCharacter, intervals: Sequence[Interval]) -> Array:
    """Deviations of all axes, each by its own robust standard deviation."""
    series = character.series
    pieces = series.pieces(intervals, 5.0 * series.step_s)
    deviation = np.concatenate([deviations(one)[2:-2] for one in pieces])
    return standardised(deviation).ravel()


def normal_quantiles(scaled: Array, points: int = _QUANTILE_POINTS) -> tuple[Array, Array]:
    """Quantiles of a normal distribution, and those of samples beside them."""
    share = np.unique(np.concatenate([np.linspace(0.0, 1.0, points), norm.cdf(np.linspace(-4.0, 4.0, 60))]))
    share = share[(share > 0.5 / len(scaled)) & (share < 1.0 - 0.5 / len(scaled))]
    return norm.ppf(share), np.quantile(scaled, share)


def beyond_words(label: str, parts: Sequence[Distribution]) -> tuple[str, str]:
    """How many times more samples lie beyond three standard deviations than of a normal distribution, in two lines."""
    beyond = np.mean([one.beyond_3_sigma for one in parts]) / BEYOND_3_SIGMA
    return f"{label}: beyond 3σ", f"{beyond:.1f} × normal"


def allan_words(sensor: Sensor, figures: AllanFigures) -> list[str]:
    """Noise density, bias instability and random walk, as far as they are told, a line for each."""
    lines = []
    for kind in KINDS:
        figure, unit = figures.of(kind), f"{sensor.unit}{_UNITS[kind]}"
        if figure.value is not None:
            lines.append(f"{_SIGNS[kind]} = {figure.value:.3g} ({figure.low:.3g} to {figure.high:.3g}) {unit}")
        elif figure.high is not None:
            lines.append(f"{_SIGNS[kind]} not told, at most {figure.high:.2g} {unit}")
        else:
            lines.append(f"{NAMES[kind]} not told")
    return lines


def tone_words(one: MotorTone) -> list[str]:
    """Frequency of a tone, and which multiple of the motors' it is, a line for each."""
    words = [f"{one.tone.frequency_hz:.0f} Hz"]
    if one.multiple:
        words.append(f"{one.multiple} ×")
    return [*words, "folded"] if one.folded else words


def vibration_title(character: SensorCharacter) -> str:
    """A sensor, and how many times noisier it is in flight."""
    vibration = character.vibration
    if vibration is None or vibration.ratio is None:
        return character.sensor.label
    limited = ", vibration-limited" if vibration.limited else ""
    return f"{character.sensor.label}: {vibration.ratio:.1f} × in flight{limited}"
