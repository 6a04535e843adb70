"""Linear models of random figures, and measurements that they make."""

import numpy as np

from fusetune.analyze.smoothing.linear_smoother import LinearModel


def random_model(seed: int, epochs: int = 12, states: int = 3, constants: int = 2, measured: int = 2) -> LinearModel:
    """A stable model whose transitions, variances and measurements differ from epoch to epoch."""
    made = np.random.default_rng(seed)
    return LinearModel(
        transition=np.eye(states) + 0.2 * made.normal(size=(epochs - 1, states, states)),
        of_constants=made.normal(size=(epochs - 1, states, constants)),
        known=made.normal(size=(epochs - 1, states)),
        process_variance=made.uniform(0.01, 0.5, (epochs - 1, states)),
        observation=made.normal(size=(measured, states)),
        observed_constants=made.normal(size=(epochs, measured, constants)),
        measured=made.normal(size=(epochs, measured)),
        measurement_variance=made.uniform(0.1, 1.0, (epochs, measured)),
        first_variance=made.uniform(0.5, 2.0, states),
        constant_variance=made.uniform(0.5, 2.0, constants),
    )
