"""How often an observation is declared inconsistent, with the interval that the number of samples allows."""

import numpy as np
import numpy.typing as npt
from scipy.special import betaincinv

from fusetune.analyze.metrics.consistency import Bounds

Array = npt.NDArray[np.float64]


def beyond_standard_deviations(innovation: Array, innovation_variance: Array, limit: float) -> npt.NDArray[np.bool_]:
    """True where |ν| > limit · √S; shapes of the inputs."""
    return np.square(innovation) > limit * limit * innovation_variance


def beyond_gate(test_ratio: Array, rejected: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """True where the axis is beyond its gate; where its gate is unknown (NaN), where the source was rejected."""
    return np.where(np.isfinite(test_ratio), test_ratio > 1.0, rejected)


def clopper_pearson(breaks: npt.ArrayLike, samples: int, confidence: float) -> Bounds:
    """Exact two-sided binomial interval of a rate.

    Parameters
    ----------
    breaks : (...) number of breaks
    samples : N > 0

    References
    ----------
    Clopper and Pearson, 1934; as quantiles of Beta(k, N − k + 1) and Beta(k + 1, N − k).
    """
    count = np.asarray(breaks, dtype=np.float64)
    tail = 0.5 * (1.0 - confidence)
    lower = betaincinv(np.maximum(count, 1.0), samples - count + 1.0, tail)
    upper = betaincinv(count + 1.0, np.maximum(samples - count, 1.0), 1.0 - tail)
    return Bounds(count / samples, np.where(count == 0, 0.0, lower), np.where(count == samples, 1.0, upper))


def break_rate(broken: npt.NDArray[np.bool_], confidence: float) -> Bounds:
    """Fusion break rate t_FB = Σ o_i / N of (..., N) flags with its Clopper–Pearson interval."""
    return clopper_pearson(np.count_nonzero(broken, axis=-1), broken.shape[-1], confidence)
