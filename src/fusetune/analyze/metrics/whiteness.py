"""Are successive innovations independent? Autocorrelation, effective number of samples, Ljung–Box statistic."""

import numpy as np
import numpy.typing as npt
from scipy.fft import next_fast_len
from scipy.special import chdtrc

from fusetune.analyze.metrics.metric import InnovationMetric, Innovations, mean_of_samples

Array = npt.NDArray[np.float64]

LJUNG_BOX_LAGS = 10
MAXIMUM_LAGS = 50
_MOST_AT_ONCE = 300_000


def autocorrelation(values: Array, lags: int) -> Array:
    """Sample autocorrelation ρ_1 … ρ_lags of the last axis.

    Parameters
    ----------
    values : (..., N) array; its mean is removed, so a constant offset does not count as correlation
    lags : number of lags, < N

    Returns
    -------
    (..., lags) array; 0 where the values do not vary
    """
    if values.ndim > 1 and values.size > _MOST_AT_ONCE:
        # the spectra of an hour's axes need not be in memory at once
        rows = [autocorrelation(row, lags) for row in values.reshape(-1, values.shape[-1])]
        return np.stack(rows).reshape(*values.shape[:-1], lags)
    centred = values - mean_of_samples(values)[..., None]
    power = np.sum(np.square(centred), axis=-1)
    # Sums of products at all lags at once: the transform of the power spectrum, padded so that nothing wraps around.
    length = next_fast_len(values.shape[-1] + lags, real=True)
    spectrum = np.fft.rfft(centred, length, axis=-1)
    products = np.fft.irfft(np.square(np.abs(spectrum)), length, axis=-1)[..., 1 : lags + 1]
    return np.divide(products, power[..., None], out=np.zeros_like(products), where=power[..., None] > 0.0)


def lag_limit(samples: int) -> int:
    """Number of lags that `samples` values can tell about: a quarter of them, at most 50."""
    return max(0, min(MAXIMUM_LAGS, samples // 4))


def effective_samples(correlation: Array, samples: int) -> Array:
    """Number of independent samples that carry as much about a mean square: N / (1 + 2 Σ ρ_k²).

    The squares of a Gaussian process correlate as ρ². The sum ends before the first lag whose |ρ| is below
    1.96/√N, as the estimates behind it are noise that would add up.

    Parameters
    ----------
    correlation : (..., K) array from `autocorrelation`
    samples : N

    Returns
    -------
    (...) array, 1 ≤ N_eff ≤ N
    """
    significant = np.cumprod(np.abs(correlation) >= 1.96 / np.sqrt(samples), axis=-1)
    total = np.sum(significant * np.square(correlation), axis=-1)
    return np.maximum(samples / (1.0 + 2.0 * total), 1.0)


def ljung_box(correlation: Array, samples: int, lags: int = LJUNG_BOX_LAGS) -> tuple[Array, Array]:
    """Ljung–Box statistic Q = N (N + 2) Σ ρ_k² / (N − k) and its p-value under whiteness, χ²(lags).

    Receiver-filtered GNSS is never white: the statistic compares sets, it does not reject one.
    """
    lags = min(lags, correlation.shape[-1])
    weights = 1.0 / (samples - np.arange(1, lags + 1))
    statistic = samples * (samples + 2.0) * np.sum(np.square(correlation[..., :lags]) * weights, axis=-1)
    return statistic, np.asarray(chdtrc(max(lags, 1), statistic), dtype=np.float64)


def _correlation(given: Innovations) -> Array:
    """Autocorrelation of ν/√S, (D, S, K)."""
    return autocorrelation(given.innovation / np.sqrt(given.innovation_variance), lag_limit(given.samples))


def _independent(given: Innovations) -> Array:
    """Number of independent samples of each axis, (D, S)."""
    return effective_samples(given.by_axis(_correlation), given.samples)


def independent_samples(given: Innovations) -> Array:
    """Number of independent samples, (S,); of a group of axes by the mean of their shares."""
    found = given.by_axis(_independent)
    return given.samples * np.mean(found / given.samples, axis=0) if given.of_group else found[0]


def _ljung_box(given: Innovations) -> tuple[Array, Array]:
    return ljung_box(given.by_axis(_correlation)[0], given.samples)


METRICS = (
    InnovationMetric(
        "lag1_correlation", "1", "correlation of successive ν/√S", lambda given: given.by_axis(_correlation)[0, :, 0],
        "nearer to 0", ("apply",), of_groups=False,
    ),
    InnovationMetric(
        "ljung_box", "1", "Ljung–Box statistic of ν/√S over 10 lags", lambda given: given.once(_ljung_box)[0],
        "lower", of_groups=False,
    ),
    InnovationMetric(
        "ljung_box_p", "1", "its p-value under whiteness, χ²(10)", lambda given: given.once(_ljung_box)[1],
        "higher", of_groups=False,
    ),
)  # fmt: skip
