"""Proper scores of the innovations: the negative log-likelihood (NLL), two robust forms and the scale-profiled one.

All are means per sample and axis in nat; lower is better. The term ln S punishes inflated noise.
"""

import functools
import math
import operator
from collections.abc import Callable, Iterable

import numpy as np
import numpy.typing as npt

from fusetune.analyze.metrics.consistency import nis_of_axes
from fusetune.analyze.metrics.metric import InnovationMetric, Innovations, InWindow, mean_of_samples

Array = npt.NDArray[np.float64]

STUDENT_T_DOF = 5.0
WINSOR_STANDARD_DEVIATIONS = 5.0
NORMAL_CONSISTENCY = 1.4826
"""Median absolute value → standard deviation, for a normal distribution."""


def gaussian_nll(innovation: Array, innovation_variance: Array) -> Array:
    """½ (ν²/S + ln S + ln 2π) of each sample; smallest in the mean where S is the true variance."""
    return _gaussian_nll(np.square(innovation) / innovation_variance, np.log(innovation_variance))


def _gaussian_nll(nis: Array, log_variance: Array) -> Array:
    return 0.5 * (nis + log_variance + math.log(2.0 * math.pi))


def student_t_nll(innovation: Array, innovation_variance: Array, dof: float = STUDENT_T_DOF) -> Array:
    """NLL of each sample under Student's t with variance S: an outlier costs its logarithm, not its square.

    Parameters
    ----------
    innovation, innovation_variance : arrays of one shape
    dof : degrees of freedom > 2; the scale is S (dof − 2)/dof, so that the variance is S
    """
    scale = innovation_variance * (dof - 2.0) / dof
    constant = math.lgamma(0.5 * dof) - math.lgamma(0.5 * (dof + 1.0)) + 0.5 * math.log(dof * math.pi)
    return constant + 0.5 * np.log(scale) + 0.5 * (dof + 1.0) * np.log1p(np.square(innovation) / (dof * scale))


def winsor_limit(innovation: Array) -> float:
    """Limit beyond which innovations are winsorised: 5 robust standard deviations of those of the present set.

    It must not depend on S: clipping ν/√S would let a set win by making S small. The array may be put in another order.
    """
    median = float(np.median(np.abs(innovation), overwrite_input=True))
    return WINSOR_STANDARD_DEVIATIONS * NORMAL_CONSISTENCY * median if median > 0.0 else math.inf


def winsorised(innovation: Array, limit: float | Array) -> Array:
    """Innovations clipped to ±limit, which is one figure or broadcasts against them."""
    return np.clip(innovation, -limit, limit)


def profile_nll(mean_nis: Array, mean_log_variance: Array) -> Array:
    """Scale-profiled NLL: the NLL with S multiplied by its best constant factor, without the constant ½ + ½ ln 2π.

    min over c of mean(½ ν²/(c S) + ½ ln(c S)) is reached at c = mean(ν²/S) and is ½ ln mean(ν²/S) + ½ mean ln S.
    It asks how well the filter predicts and how well it knows *when* it is uncertain, not how large R was set.

    Parameters
    ----------
    mean_nis : (...) mean of ν²/S of one source and axis
    mean_log_variance : (...) mean of ln S of the same samples
    """
    with np.errstate(divide="ignore"):
        return 0.5 * np.log(mean_nis) + 0.5 * np.asarray(mean_log_variance)


def log_variance(given: Innovations) -> Array:
    """ln S of each axis and sample, (D, S, N)."""
    return np.log(given.innovation_variance)


def clipped_nis(given: Innovations) -> Array:
    """ν²/S of winsorised ν, of each axis and sample, (D, S, N)."""
    axes = zip(given.innovation, given.winsor_limits(), strict=True)
    return np.square(np.stack([winsorised(nu, limit) for nu, limit in axes])) / given.innovation_variance


def gaussian_terms(given: Innovations) -> Array:
    """`gaussian_nll` of each axis and sample, (D, S, N)."""
    return _gaussian_nll(given.by_axis(nis_of_axes), given.by_axis(log_variance))


def student_t_terms(given: Innovations) -> Array:
    """`student_t_nll` of each axis and sample, (D, S, N)."""
    return student_t_nll(given.innovation, given.innovation_variance)


def _clipped_terms(given: Innovations) -> Array:
    return _gaussian_nll(given.by_axis(clipped_nis), given.by_axis(log_variance))


def _mean_of(terms: Callable[[Innovations], Array]) -> Callable[[Innovations], Array]:
    """The mean of what each axis and sample gives, summed over the axes."""

    def means(given: Innovations) -> Array:
        return mean_of_samples(given.by_axis(terms))

    return lambda given: _sum(given.by_axis(means))


def _profile_of(nis: Callable[[Innovations], Array]) -> Callable[[Innovations], Array]:
    """`profile_nll` of each axis, each scaled by itself, summed over the axes."""

    def profiles(given: Innovations) -> Array:
        return profile_nll(mean_of_samples(given.by_axis(nis)), given.by_axis(_mean_log_variance))

    return lambda given: _sum(given.by_axis(profiles))


def _mean_log_variance(given: Innovations) -> Array:
    return mean_of_samples(given.by_axis(log_variance))


def _sum(values: Iterable[Array]) -> Array:
    """Likelihoods of several axes: the sum of theirs."""
    return functools.reduce(operator.add, values)


def _clipped_nll(given: Innovations) -> Array:
    return _sum(given.by_axis(_clipped_terms))


METRICS = (
    InnovationMetric(
        "nll", "nat", "negative log-likelihood per sample",
        _mean_of(gaussian_terms), "lower", ("apply",),
    ),
    InnovationMetric(
        "nll_student_t", "nat", "the same under Student's t with 5 degrees of freedom",
        _mean_of(student_t_terms), "lower",
    ),
    InnovationMetric(
        "nll_winsorised", "nat", "the same, clipped at 5 robust standard deviations of the present set's",
        _mean_of(_clipped_terms), "lower",
        window=InWindow("worst_window_nll_winsorised", _clipped_nll),
    ),
    InnovationMetric(
        "nll_profile", "nat", "the same with the best constant factor on S, less ½ + ½ ln 2π",
        _profile_of(nis_of_axes), "lower",
    ),
    InnovationMetric(
        "nll_profile_winsorised", "nat", "that of clipped innovations",
        _profile_of(clipped_nis), "lower",
    ),
)  # fmt: skip
