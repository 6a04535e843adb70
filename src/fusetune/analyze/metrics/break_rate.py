"""How often an observation is declared inconsistent, with the interval that the number of samples allows."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.special import betaincinv

from fusetune.analyze.metrics.metric import Bounds, InnovationMetric, Innovations, InWindow

Array = npt.NDArray[np.float64]


def beyond_standard_deviations(innovation: Array, innovation_variance: Array, limit: float) -> npt.NDArray[np.bool_]:
    """True where |ν| > limit · √S; shapes of the inputs."""
    return np.square(innovation) > limit * limit * innovation_variance


def beyond_gate(test_ratio: Array, rejected: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """True where the axis is beyond its gate; where its gate is unknown, where the source was rejected."""
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


def _beyond_3(given: Innovations) -> npt.NDArray[np.bool_]:
    return beyond_standard_deviations(given.innovation, given.innovation_variance, 3)


def _beyond_5(given: Innovations) -> npt.NDArray[np.bool_]:
    return beyond_standard_deviations(given.innovation, given.innovation_variance, 5)


def _beyond_gate(given: Innovations) -> npt.NDArray[np.bool_]:
    return beyond_gate(given.test_ratio, given.rejected)


def _metric(
    limit: str, label: str, words: str, beyond: Callable[[Innovations], npt.NDArray[np.bool_]], used: tuple[str, ...]
) -> InnovationMetric:
    """`beyond` tells of each axis and sample, (D, S, N), whether it is beyond the limit."""

    def any_beyond(given: Innovations) -> npt.NDArray[np.bool_]:
        return np.logical_or.reduce(given.by_axis(beyond), axis=0)

    def broken(given: Innovations) -> npt.NDArray[np.bool_]:
        return given.once_if_few(any_beyond)

    return InnovationMetric(
        f"break_rate_{limit}",
        "1",
        f"share with any axis beyond {words}, with Clopper–Pearson bounds",
        lambda given: break_rate(broken(given), given.confidence),
        "lower",
        used,
        window=InWindow(f"worst_window_break_rate_{limit}", broken),
        on_ground=limit == "gate",
        label=label,
    )


METRICS = (
    _metric("3sd", "3 σ", "3 σ", _beyond_3, ("report",)),
    _metric("5sd", "5 σ", "5 σ", _beyond_5, ("report",)),
    _metric("gate", "gate", "its gate", _beyond_gate, ("apply", "report")),
)
