"""Which tones of a flight are the motors', whether they follow the throttle, and whether they are folded.

A log of rate f_s shows a tone of f at |f − n f_s|: PX4 averages the sensor's samples to those that it logs, which makes
tones above half the rate weaker, not absent. Folded an odd number of times a tone goes down as the motors speed up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.flight.throttle import Throttle
from fusetune.analyze.sensor_noise.periodograms import frequencies, periodograms, segment_starts
from fusetune.analyze.sensor_noise.sensor_series import SensorSeries
from fusetune.analyze.sensor_noise.spectrum import Tone, segment_length

Array = npt.NDArray[np.float64]

MOST_HARMONIC = 4
LOWEST_FUNDAMENTAL_HZ = 25.0
"""Of a large propeller at hover."""
SAME_SHARE, SAME_HZ = 0.03, 1.5
"""A tone is a multiple when it lies that near to it: rotors of one vehicle turn some per cent apart."""
FOLLOWS = 0.5
"""Correlation with the throttle from which a tone follows it …"""
SURE = 4.0
"""… and its t statistic."""
FEWEST_SPECTRA = 12
LEAST_THROTTLE_SPREAD = 0.005
"""With less change of throttle nothing can follow it."""
_OF_TWO_BLADES = 2
_TRACKED_SHARE, _TRACKED_HZ = 0.15, 6.0
_TRACKED_ABOVE = 3.0


@dataclass(frozen=True)
class MotorTone:
    """A tone with what it is taken for.

    Attributes
    ----------
    tone : as the spectrum shows it
    multiple : of the fundamental; 0 where it is none
    folded : whether the multiple lies above half the log's rate and shows where it is folded to
    slope_hz : how far it moves while the throttle goes from 0 to 1, Hz; None where it does not follow, or that is not
        known
    """

    tone: Tone
    multiple: int
    folded: bool
    slope_hz: float | None

    def document(self) -> dict[str, float | int | bool | None]:
        """As a JSON object."""
        return {**vars(self.tone), "multiple": self.multiple, "folded": self.folded, "slope_hz": self.slope_hz}


@dataclass(frozen=True)
class MotorTones:
    """Tones of a sensor in flight.

    Attributes
    ----------
    listed : the strongest first
    fundamental_hz : of the motors; None where no tone follows the throttle or has a multiple
    throttle : what was known of it: "varied", "constant", "not logged"
    """

    listed: tuple[MotorTone, ...]
    fundamental_hz: float | None
    throttle: str


def motor_tones(
    series: SensorSeries, intervals: Sequence[Interval], found: Sequence[Tone], command: Throttle | None
) -> MotorTones:
    """Tell the motors' tones among those of a spectrum.

    Parameters
    ----------
    series : of the sensor
    intervals : in the air, µs
    found : tones of the spectrum over these intervals
    command : of the motors; None where the log has none
    """
    tracks = _spectra_in_time(series, intervals) if found and command is not None else None
    throttle = "not logged"
    slopes: list[float | None] = [None] * len(found)
    if tracks is not None and command is not None:
        at = np.interp(tracks.time, command.time, command.share)
        throttle = "varied" if float(np.std(at)) >= LEAST_THROTTLE_SPREAD else "constant"
        if throttle == "varied":
            slopes = [_slope(tracks, one, at) for one in found]
    rate = series.rate_hz
    fundamental = _fundamental(found, slopes, rate)
    listed = []
    for tone, slope in zip(found, slopes, strict=True):
        multiple, folded = _multiple_of(tone.frequency_hz, fundamental, rate)
        listed.append(MotorTone(tone, multiple, folded or (slope is not None and slope < 0.0), slope))
    return MotorTones(tuple(listed), fundamental, throttle)


def shown_at(frequency_hz: float, rate_hz: float) -> float:
    """Where a log of this rate shows a tone, Hz."""
    return abs(frequency_hz - rate_hz * round(frequency_hz / rate_hz))


@dataclass(frozen=True)
class _Tracks:
    time: npt.NDArray[np.int64]
    frequency: Array
    density: Array


def _spectra_in_time(series: SensorSeries, intervals: Sequence[Interval]) -> _Tracks | None:
    """Spectral density of short times, axes summed; None of too few."""
    length = segment_length(series) // 2
    times, densities = [], []
    for start, stop in intervals:
        rows = slice(*np.searchsorted(series.time, (start, stop)))
        values, time = series.values[rows], series.time[rows]
        if len(values) < 2 * length:
            continue
        densities += [some.sum(axis=1) for some in periodograms(values, series.rate_hz, length)]
        times.append(time[segment_starts(len(values), length) + length // 2])
    if not times or sum(map(len, times)) < FEWEST_SPECTRA:
        return None
    return _Tracks(np.concatenate(times), frequencies(length, series.rate_hz), np.concatenate(densities))


def _slope(tracks: _Tracks, tone: Tone, throttle: Array) -> float | None:
    """Hz per unit of throttle by which the centre of a tone moves; None where it does not follow."""
    reach = max(_TRACKED_SHARE * tone.frequency_hz, _TRACKED_HZ)
    near = np.abs(tracks.frequency - tone.frequency_hz) <= reach
    density = tracks.density[:, near]
    base = np.median(density, axis=1, keepdims=True)
    weight = np.maximum(density - _TRACKED_ABOVE * base, 0.0)
    seen = weight.sum(axis=1) > 0.0
    if np.count_nonzero(seen) < FEWEST_SPECTRA:
        return None
    centre = (weight[seen] @ tracks.frequency[near]) / weight[seen].sum(axis=1)
    moved, asked = centre - centre.mean(), throttle[seen] - throttle[seen].mean()
    spread = math.sqrt(float(moved @ moved) * float(asked @ asked))
    if spread <= 0.0:
        return None
    correlation = float(moved @ asked) / spread
    # neighbouring spectra share half of their samples
    independent = 0.5 * np.count_nonzero(seen)
    sure = abs(correlation) * math.sqrt(max(independent - 2.0, 0.0) / max(1.0 - correlation**2, 1e-12))
    if abs(correlation) < FOLLOWS or sure < SURE:
        return None
    return float(moved @ asked) / float(asked @ asked)


def _fundamental(found: Sequence[Tone], slopes: Sequence[float | None], rate_hz: float) -> float | None:
    """Frequency whose multiples explain most tones; one that follows the throttle needs no multiple.

    Folded multiples lie anywhere, so that by chance some tone is near to one: of them only the second counts, which two
    blades make, and for half.
    """
    best, most = None, 1.0
    for tone, slope in zip(found, slopes, strict=True):
        if tone.frequency_hz < LOWEST_FUNDAMENTAL_HZ or (slope is not None and slope < 0.0):
            continue
        shown = [_multiple_of(one.frequency_hz, tone.frequency_hz, rate_hz) for one in found]
        score = float(len({multiple for multiple, folded in shown if multiple and not folded}))
        score += 0.5 if (_OF_TWO_BLADES, True) in shown else 0.0
        score += 1.0 if slope is not None else 0.0
        if score > most:
            best, most = tone.frequency_hz, score
    return best


def _multiple_of(frequency_hz: float, fundamental_hz: float | None, rate_hz: float) -> tuple[int, bool]:
    """Which multiple a tone is, and whether that is folded; 0 where it is none."""
    if fundamental_hz is None:
        return 0, False
    for multiple in range(1, MOST_HARMONIC + 1):
        true = multiple * fundamental_hz
        if abs(shown_at(true, rate_hz) - frequency_hz) <= max(SAME_SHARE * frequency_hz, SAME_HZ):
            return multiple, true > 0.5 * rate_hz
    return 0, False
