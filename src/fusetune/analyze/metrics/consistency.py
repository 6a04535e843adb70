"""Does the filter believe what it should? Mean normalised innovation squared (NIS) against its χ² bounds."""

import numpy as np
import numpy.typing as npt
from scipy.special import chdtri

from fusetune.analyze.metrics.innovation_metrics import squares
from fusetune.analyze.metrics.metric import Bounds, InnovationMetric, Innovations, InWindow, mean_of_samples
from fusetune.analyze.metrics.whiteness import independent_samples

Array = npt.NDArray[np.float64]


def mean_nis(innovation: Array, innovation_variance: Array) -> Array:
    """Averaged normalised innovation r = Σ νᵀ S⁻¹ ν / N in its diagonal form.

    Parameters
    ----------
    innovation, innovation_variance : (D, ..., N) arrays, components first; the variance is R + H P Hᵀ

    Returns
    -------
    (...) array; D is expected. A large S makes it tiny, so a small value alone is no merit.
    """
    return mean_of_samples(np.sum(np.square(innovation) / innovation_variance, axis=0))


def chi2_quantile(probability: float, dof: Array | float) -> Array:
    """Quantile of χ² with any positive (also fractional) number of degrees of freedom."""
    return np.asarray(chdtri(dof, 1.0 - probability), dtype=np.float64)


def paper_bounds(nis: Array, samples: int, dimension: int, confidence: float) -> Bounds:
    """Two-sided acceptance region of the mean NIS as the paper states it.

    N r ~ χ²(N·dim − dim), so r lies between the α/2 and 1 − α/2 quantiles divided by N. Samples are taken as
    independent, which filtered measurements never are: see `effective_bounds`.
    """
    return _bounds(nis, float(samples), float(dimension * samples - dimension), confidence)


def effective_bounds(nis: Array, effective_samples: Array, dimension: int, confidence: float) -> Bounds:
    """Bounds of the mean NIS for correlated samples: N is replaced by N_eff, r N_eff ~ χ²(dim N_eff)."""
    return _bounds(nis, effective_samples, dimension * np.asarray(effective_samples), confidence)


def _bounds(nis: Array, samples: Array | float, dof: Array | float, confidence: float) -> Bounds:
    nis = np.asarray(nis, dtype=np.float64)
    tail = 0.5 * (1.0 - confidence)
    positive = np.asarray(dof) > 0.0
    safe = np.where(positive, dof, 1.0)
    lower = np.where(positive, chi2_quantile(tail, safe) / samples, 0.0)
    upper = np.where(positive, chi2_quantile(1.0 - tail, safe) / samples, np.inf)
    return Bounds(nis, np.broadcast_to(lower, nis.shape), np.broadcast_to(upper, nis.shape))


def j_nis(nis: Array, dimension: int) -> Array:
    """Distance of the mean NIS from its expectation, |ln(mean NIS / dim)|; 0 is consistent."""
    with np.errstate(divide="ignore"):
        return np.abs(np.log(np.asarray(nis) / dimension))


def c_nis(innovation: Array, innovation_variance: Array) -> Array:
    """J_NIS + |ln(var NIS / 2 dim)|: also the spread of the NIS must be that of χ²(dim).

    Parameters
    ----------
    innovation, innovation_variance : (D, ..., N) arrays, components first, N ≥ 2
    """
    return _c_nis(np.sum(np.square(innovation) / innovation_variance, axis=0), innovation.shape[0])


def _c_nis(nis: Array, dimension: int) -> Array:
    with np.errstate(divide="ignore"):
        spread = np.abs(np.log(np.var(nis, axis=-1, ddof=1) / (2.0 * dimension)))
    return j_nis(mean_of_samples(nis), dimension) + spread


def nis_of_axes(given: Innovations) -> Array:
    """ν²/S of each axis and sample, (D, S, N)."""
    return given.by_axis(squares) / given.innovation_variance


def _summed_nis(given: Innovations) -> Array:
    return np.asarray(np.sum(given.by_axis(nis_of_axes), axis=0))


def _nis(given: Innovations) -> Array:
    return given.once_if_few(_summed_nis)


def _mean_nis(given: Innovations) -> Array:
    return mean_of_samples(_nis(given))


def _paper_bounds(given: Innovations) -> Bounds:
    return paper_bounds(given.once(_mean_nis), given.samples, given.dimension, given.confidence)


def _effective_bounds(given: Innovations) -> Bounds:
    return effective_bounds(given.once(_mean_nis), given.once(independent_samples), given.dimension, given.confidence)


METRICS = (
    InnovationMetric(
        "mean_nis", "1", "mean of ν²/S, summed over the axes, with χ² bounds for N samples (the paper's)",
        _paper_bounds, "nearer to the number of axes", ("apply", "report"),
        window=InWindow("worst_window_nis", _nis), on_ground=True,
    ),
    InnovationMetric(
        "mean_nis_effective", "1", "the same with bounds for N_eff = N / (1 + 2 Σ ρ²) samples",
        _effective_bounds, "nearer to the number of axes", ("report",),
        samples=lambda given: given.once(independent_samples),
    ),
    InnovationMetric(
        "j_nis", "1", "\\|ln(mean NIS / n)\\|", lambda given: j_nis(given.once(_mean_nis), given.dimension),
        "lower", ("apply",),
    ),
    InnovationMetric(
        "c_nis", "1", "that plus \\|ln(var NIS / 2n)\\|",
        lambda given: _c_nis(_nis(given), given.dimension), "lower", ("apply",),
    ),
)  # fmt: skip
