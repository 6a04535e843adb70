"""Spectra of segments; the expected ones are SciPy's, whose package is not loaded elsewhere for them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import spectrogram, welch

from fusetune.analyze.sensor_noise.periodograms import frequencies, periodograms, segment_starts

RATE_HZ, LENGTH = 250.0, 64


@pytest.mark.parametrize("samples", [64, 65, 5000])
def test_spectra_are_those_of_scipy(samples: int) -> None:
    """Of 5000 samples there are more segments than are transformed at once."""
    values = 9.8 + np.random.default_rng(3).normal(size=(samples, 3)) * [1.0, 0.1, 1e-4]
    found = np.concatenate(list(periodograms(values, RATE_HZ, LENGTH)))
    frequency, density = welch(values, RATE_HZ, nperseg=LENGTH, axis=0)
    np.testing.assert_allclose(frequencies(LENGTH, RATE_HZ), frequency)
    np.testing.assert_allclose(found.mean(axis=0).T[1:], density[1:], rtol=1e-9)
    _, middle, each = spectrogram(values, RATE_HZ, "hann", LENGTH, LENGTH // 2, axis=0)
    np.testing.assert_allclose((segment_starts(samples, LENGTH) + LENGTH // 2) / RATE_HZ, middle)
    np.testing.assert_allclose(np.moveaxis(found, 0, -1)[:, 1:], np.moveaxis(each, 0, 1)[:, 1:], rtol=1e-8)


def test_fewer_samples_than_a_segment_have_none() -> None:
    assert segment_starts(LENGTH - 1, LENGTH).size == 0
