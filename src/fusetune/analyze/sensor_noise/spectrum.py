"""Spectral densities of a sensor at rest and in flight, and the tones that stand out of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_closing, percentile_filter, uniform_filter1d

from fusetune.analyze.flight.intervals import Interval, stretches
from fusetune.analyze.metrics.consistency import chi2_quantile
from fusetune.analyze.sensor_noise.periodograms import frequencies, periodograms, segment_starts
from fusetune.analyze.sensor_noise.sensor_series import SensorSeries

Array = npt.NDArray[np.float64]

SEGMENT_S = 2.5
"""Length of Welch's segments: 0.4 Hz apart, and a flight of a minute has nearly fifty of them."""
FEWEST_SEGMENTS = 4
LOWEST_TONE_HZ = 15.0
"""Below it a vehicle flies: its own motion, and its controller's."""
LOWEST_FLOOR_HZ = 10.0
FLOOR = 0.2
_SMOOTHED_HZ = 2.0
_BINS_OF_HANN = 1.5
"""Noise bandwidth of Hann's window, in frequencies."""
UPPER_SHARE = 0.9
"""Of the Nyquist frequency; up to there the floor is read."""
_BASELINE_HZ = 40.0
_BASELINE_PERCENTILE = 30.0
"""The level around a tone is that of the lower third: the shaking of four rotors may fill half of the band."""
_ONE_TONE_HZ = 3.0
"""Peaks nearer to each other are one tone."""
_TONE = 3.0
"""A tone stands so many times above the level around it, or six standard deviations where the segments are few."""
_SIGNIFICANT = 6.0
_CORRELATION_OF_SEGMENTS = 0.8
"""Independent segments per segment at half overlap with Hann's window (Welch 1967)."""


@dataclass(frozen=True)
class Spectrum:
    """One-sided spectral density.

    Attributes
    ----------
    frequency_hz : (F,)
    density : (F, axes), unit²/Hz
    segments : how many were averaged
    """

    frequency_hz: Array
    density: Array
    segments: int

    @property
    def total(self) -> Array:
        """(F,) sum over the axes, unit²/Hz."""
        return np.asarray(self.density.sum(axis=1))

    @property
    def resolution_hz(self) -> float:
        """Distance of two frequencies, Hz."""
        return float(self.frequency_hz[1] - self.frequency_hz[0])

    def broadband(self) -> float:
        """Floor of the spectrum above the vehicle's motion, mean of the axes, unit²/Hz.

        The lower fifth of the densities from 10 Hz to 0.9 of Nyquist, each a mean over 2 Hz: motion falls to the floor
        from below, and the shaking of motors, which does not add up over time as white noise does, stands on it. The
        lower fifth of white noise lies below its mean by what χ² has for the degrees of freedom of such a mean; that is
        put right.
        """
        highest = UPPER_SHARE * float(self.frequency_hz[-1])
        band = (self.frequency_hz >= min(LOWEST_FLOOR_HZ, 0.5 * highest)) & (self.frequency_hz <= highest)
        together = max(round(_SMOOTHED_HZ / self.resolution_hz), 1)
        independent = max(_CORRELATION_OF_SEGMENTS * self.segments, 1.0) * max(together / _BINS_OF_HANN, 1.0)
        below = float(chi2_quantile(FLOOR, 2.0 * independent)) / (2.0 * independent)
        smooth = uniform_filter1d(self.density, together, axis=0, mode="nearest")
        return float(np.mean(np.quantile(smooth[band], FLOOR, axis=0))) / below


@dataclass(frozen=True)
class Tone:
    """A narrow part of a spectrum that stands out.

    Attributes
    ----------
    frequency_hz : centre of its power
    amplitude : of a sine with its power, all axes together, unit of the sensor
    above : how many times its density stands above the level around it
    """

    frequency_hz: float
    amplitude: float
    above: float


def spectrum(series: SensorSeries, intervals: Sequence[Interval]) -> Spectrum | None:
    """Welch's estimate over all stretches without a gap inside the intervals, µs; None where they are too short."""
    length = segment_length(series)
    pieces = series.pieces(intervals, length * series.step_s)
    segments = sum(len(segment_starts(len(piece), length)) for piece in pieces)
    if segments < FEWEST_SEGMENTS:
        return None
    rate_hz = 1.0 / series.step_s
    density = sum(some.sum(axis=0) for piece in pieces for some in periodograms(piece, rate_hz, length))
    return Spectrum(frequencies(length, rate_hz)[1:], (np.asarray(density).T / segments)[1:], segments)


def segment_length(series: SensorSeries) -> int:
    """Samples of a segment, a power of two."""
    return int(2 ** round(math.log2(max(SEGMENT_S * series.rate_hz, 16.0))))


def tones(found: Spectrum) -> tuple[Tone, ...]:
    """Tones above 15 Hz, the strongest first."""
    width = max(int(_BASELINE_HZ / found.resolution_hz) | 1, 5)
    level = found.total
    if len(level) <= width:
        return ()
    smooth = np.convolve(np.pad(level, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")
    base = percentile_filter(smooth, _BASELINE_PERCENTILE, size=width, mode="nearest")
    ratio = smooth / np.maximum(base, np.finfo(float).tiny)
    least = max(_TONE, 1.0 + _SIGNIFICANT / math.sqrt(_CORRELATION_OF_SEGMENTS * found.segments))
    high = (ratio > 1.0 + 0.5 * (least - 1.0)) & (found.frequency_hz >= LOWEST_TONE_HZ)
    # rotors turn some per cent apart, and what they shake at is told as one
    closed = binary_closing(np.pad(high, width), np.ones(max(int(_ONE_TONE_HZ / found.resolution_hz), 1), np.bool_))[
        width:-width
    ]
    runs = (slice(*run) for run in stretches(closed))
    listed = [_tone(found, level - base, ratio, run) for run in runs if ratio[run].max() >= least]
    return tuple(sorted(listed, key=lambda one: -one.amplitude))


def _tone(found: Spectrum, excess: Array, ratio: Array, run: slice) -> Tone:
    power = np.maximum(excess[run], 0.0)
    frequency = float(power @ found.frequency_hz[run] / power.sum())
    return Tone(frequency, math.sqrt(2.0 * float(power.sum()) * found.resolution_hz), float(ratio[run].max()))
