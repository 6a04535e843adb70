"""Proper scores of the innovations: the negative log-likelihood (NLL), two robust forms and the scale-profiled one.

All are means per sample and axis in nat; lower is better. The term ln S punishes inflated noise.
"""

import functools
import math
import operator
from collections.abc import Callable, Iterable

import numpy as np
import numpy.typing as npt

from fusetune.analyze.metrics.metric import InnovationMetric, Innovations, InWindow

Array = npt.NDArray[np.float64]

STUDENT_T_DOF = 5.0
WINSOR_STANDARD_DEVIATIONS = 5.0
NORMAL_CONSISTENCY = 1.4826
"""Median absolute value → standard deviation, for a normal distribution."""


def gaussian_nll(innovation: Array, innovation_variance: Array) -> Array:
    """½ (ν²/S + ln S + ln 2π) of each sample; smallest in the mean where S is the true variance."""
    return 0.5 * (np.square(innovation) / innovation_variance + np.log(innovation_variance) + math.log(2.0 * math.pi))


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


def _winsorised(given: Innovations) -> Array:
    return np.stack([winsorised(nu, limit) for nu, limit in zip(given.innovation, given.winsor_limits(), strict=True)])


def _mean_log_variance(given: Innovations) -> Array:
    return np.asarray(np.mean(np.log(given.innovation_variance), axis=-1))


def _sum(values: Iterable[Array]) -> Array:
    """Likelihoods of several axes: the sum of theirs, each axis winsorised and scaled by itself."""
    return functools.reduce(operator.add, values)


def _mean(nll: Callable[[Array, Array], Array], innovation: Array, given: Innovations) -> Array:
    return _sum(np.mean(nll(*axis), axis=-1) for axis in zip(innovation, given.innovation_variance, strict=True))


def _profile(innovation: Array, given: Innovations) -> Array:
    axes = zip(innovation, given.innovation_variance, given.once(_mean_log_variance), strict=True)
    return _sum(profile_nll(np.mean(np.square(nu) / s, axis=-1), log_s) for nu, s, log_s in axes)


def _winsorised_nll(given: Innovations) -> Array:
    return _sum(map(gaussian_nll, given.once(_winsorised), given.innovation_variance))


METRICS = (
    InnovationMetric(
        "nll", "nat", "negative log-likelihood per sample",
        lambda given: _mean(gaussian_nll, given.innovation, given), "lower", ("apply",),
    ),
    InnovationMetric(
        "nll_student_t", "nat", "the same under Student's t with 5 degrees of freedom",
        lambda given: _mean(student_t_nll, given.innovation, given), "lower",
    ),
    InnovationMetric(
        "nll_winsorised", "nat", "the same, clipped at 5 robust standard deviations of the present set's",
        lambda given: _mean(gaussian_nll, given.once(_winsorised), given), "lower",
        window=InWindow("worst_window_nll_winsorised", _winsorised_nll),
    ),
    InnovationMetric(
        "nll_profile", "nat", "the same with the best constant factor on S, less ½ + ½ ln 2π",
        lambda given: _profile(given.innovation, given), "lower",
    ),
    InnovationMetric(
        "nll_profile_winsorised", "nat", "that of clipped innovations",
        lambda given: _profile(given.once(_winsorised), given), "lower",
    ),
)  # fmt: skip
