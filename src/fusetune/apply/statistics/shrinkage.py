"""What a mean difference is worth in expectation: measured ones are lucky or unlucky, the more the less sure they are.

The true differences of the candidates are taken for normal around none, with the variance that is left of the measured
ones when their errors are taken out. The expectation of each, given what was measured, is then its difference times
σ²/(σ² + e²), with its own standard error e.

References
----------
Efron and Morris, "Stein's estimation rule and its competitors: an empirical Bayes approach", JASA 68, 1973.
"""

from collections.abc import Sequence

import numpy as np


def expected_differences(differences: Sequence[float], errors: Sequence[float | None]) -> list[float]:
    """Expected true differences of the candidates, nat.

    Parameters
    ----------
    errors : standard errors; None where one is not known, which leaves the difference as it is
    """
    values = np.array(differences, dtype=np.float64)
    known = np.array([error is not None for error in errors])
    noise = np.square([error or 0.0 for error in errors])
    if not known.any():
        return values.tolist()
    spread = max(float(np.mean(np.square(values[known]) - noise[known])), 0.0)
    total = spread + noise
    factor = np.where(known & (total > 0.0), np.divide(spread, total, out=np.ones_like(total), where=total > 0.0), 1.0)
    return (values * factor).tolist()
