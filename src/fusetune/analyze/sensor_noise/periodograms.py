"""Periodograms of overlapping segments, of which Welch's estimate is the mean and a spectrogram the row.

The same figures as `scipy.signal.welch` and `scipy.signal.spectrogram`, a segment's mean taken off and Hann's window
laid on: that package loads SciPy's statistics, too, half a second in every process that asks for one spectrum.

References
----------
Welch, "The use of fast Fourier transform for the estimation of power spectra", 1967.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.fft import rfft, rfftfreq

Array = npt.NDArray[np.float64]

_AT_ONCE = 64
"""Segments that are transformed together: what they take of memory does not grow with the flight."""


def frequencies(length: int, rate_hz: float) -> Array:
    """(F,) of segments of so many samples, Hz."""
    return np.asarray(rfftfreq(length, 1.0 / rate_hz))


def segment_starts(samples: int, length: int) -> npt.NDArray[np.int64]:
    """(K,) first samples of the segments that overlap by half and lie within a series."""
    return np.arange(0, max(samples - length + 1, 0), length - length // 2, dtype=np.int64)


def periodograms(values: Array, rate_hz: float, length: int) -> Iterator[Array]:
    """One-sided densities (…, axes, F) of the segments of `segment_starts`, some at a time, unit²/Hz.

    Parameters
    ----------
    values : (N, axes)
    length : samples of a segment, even
    """
    window = _hann(length)
    window = window / np.sqrt(rate_hz * np.sum(window**2))
    segments = np.lib.stride_tricks.sliding_window_view(values, length, axis=0)
    starts = segment_starts(len(values), length)
    for first in range(0, len(starts), _AT_ONCE):
        some = segments[starts[first : first + _AT_ONCE]]
        found = rfft((some - some.mean(axis=-1, keepdims=True)) * window)
        density = found.real**2 + found.imag**2
        # what lies at negative frequencies; neither 0 nor the Nyquist frequency has such a twin
        density[..., 1:-1] *= 2.0
        yield density


@lru_cache(maxsize=8)
def _hann(length: int) -> Array:
    """Hann's window, periodic."""
    return np.asarray(0.5 + 0.5 * np.cos(np.linspace(-np.pi, np.pi, length + 1)[:-1]))
