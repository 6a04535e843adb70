"""Size of the innovations: root mean square per component, horizontal and vertical."""

import numpy as np
import numpy.typing as npt

from fusetune.analyze.metrics.metric import SOURCE_UNIT, InnovationMetric, Innovations, InWindow, mean_of_samples

Array = npt.NDArray[np.float64]


def rms_innovation(innovation: Array) -> Array:
    """Averaged innovation of one component.

    Parameters
    ----------
    innovation : (..., N) array, unit of the source

    Returns
    -------
    (...) array: sqrt(Σ ν² / N)

    References
    ----------
    García, Molina, Trincado: averaged innovation over N_T measurements.
    """
    return np.sqrt(mean_of_samples(np.square(innovation)))


def rms_norm(innovation: Array) -> Array:
    """Averaged innovation of several components: the root mean of the squared residual norm.

    Parameters
    ----------
    innovation : (D, ..., N) array, the components first

    Returns
    -------
    (...) array: sqrt(Σ |ν|² / N); with D = 2 the paper's horizontal figure, with D = 1 the vertical one
    """
    return np.sqrt(mean_of_samples(np.sum(np.square(innovation), axis=0)))


def mean_innovation(innovation: Array) -> Array:
    """Mean of the innovations, (..., N) → (...); an unbiased model has 0."""
    return mean_of_samples(innovation)


def squares(given: Innovations) -> Array:
    """ν² of each axis and sample, (D, S, N)."""
    return np.square(given.innovation)


def _squared_norm(given: Innovations) -> Array:
    return np.asarray(np.sum(given.by_axis(squares), axis=0))


def _squared_norms(given: Innovations) -> Array:
    return given.once_if_few(_squared_norm)


METRICS = (
    InnovationMetric(
        "mean_innovation", SOURCE_UNIT, "mean", lambda given: mean_innovation(given.innovation[0]), "nearer to 0",
        of_groups=False,
    ),
    InnovationMetric(
        "rms_innovation", SOURCE_UNIT, "root mean square; of a group, of the norm",
        lambda given: np.sqrt(mean_of_samples(_squared_norms(given))), "lower", ("apply", "report"),
        window=InWindow("worst_window_rms", _squared_norms, np.sqrt), on_ground=True,
    ),
)  # fmt: skip
