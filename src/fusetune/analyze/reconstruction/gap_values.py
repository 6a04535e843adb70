"""What a signal most probably was where it is missing, from what it is like where it is not.

The missing values of a stationary signal are estimated by their conditional mean given the values around the gap: the
best linear estimate (Wiener, 1949), with the autocovariance taken from the signal itself. For a slow signal that is
interpolation; vibration is carried into the gap as far as it keeps its phase, and averaged out where it does not, which
a line between two vibrating neighbours would not do.
"""

from __future__ import annotations

import numpy as np

NEIGHBOURS = 16
"""Values on each side of a gap that are looked at."""

RIDGE = 1e-3
"""Least variance, as a share of the signal's, in any direction; keeps the equations solvable for periodic signals."""

MIN_PAIRS = 64
TRIAL_DISTANCE = 5
MIN_TRIALS, MAX_TRIALS = 16, 2000
CHUNK = 2048


def fill_missing(signal: np.ndarray, present: np.ndarray, first: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Estimate the missing values of a signal on an even grid.

    Of two estimates, the conditional mean and the line between the neighbours, the one is taken that would have been
    nearer to the signal in gaps of the same lengths where the signal is known: the line wins where the vehicle hardly
    vibrates and manoeuvres decide.

    Parameters
    ----------
    signal : (N,) values, anything where missing
    present : (N,) whether each value is there
    first, count : (G,) position and number of missing values of the gaps to fill

    Returns
    -------
    (sum of count,) values of the gaps, one after the other
    """
    mean = float(signal[present].mean())
    deviation = np.where(present, signal - mean, 0.0)
    covariance = autocovariance(deviation, present, 2 * NEIGHBOURS + int(count.max(initial=0)))
    if covariance is None or _line_is_nearer(deviation, present, first, count, covariance):
        return _on_the_line(signal, first, count)
    return _conditional_means(deviation, present, first, count, covariance) + mean


def _line_is_nearer(
    deviation: np.ndarray, present: np.ndarray, first: np.ndarray, count: np.ndarray, covariance: np.ndarray
) -> bool:
    """Compare both estimates of the sum over gaps made where the signal is known: right after each real gap."""
    trial = first + count + TRIAL_DISTANCE
    fits = trial + count + 1 < len(deviation)
    trial, length = trial[fits], count[fits]
    known_so_far = np.concatenate([[0], np.cumsum(present)])
    whole = known_so_far[trial + length + 1] - known_so_far[trial - 1] == length + 2
    trial, length = trial[whole][:MAX_TRIALS], length[whole][:MAX_TRIALS]
    if len(trial) < MIN_TRIALS:
        return False
    left_out = present.copy()
    rows = np.repeat(trial, length) + _place_within(length)
    left_out[rows] = False
    starts = np.concatenate([[0], np.cumsum(length)[:-1]])
    truth = np.add.reduceat(deviation[rows], starts)
    mean = np.add.reduceat(_conditional_means(deviation, left_out, trial, length, covariance), starts)
    line = np.add.reduceat(_on_the_line(deviation, trial, length), starts)
    return bool(np.sum((line - truth) ** 2) < np.sum((mean - truth) ** 2))


def _conditional_means(
    deviation: np.ndarray, present: np.ndarray, first: np.ndarray, count: np.ndarray, covariance: np.ndarray
) -> np.ndarray:
    start = np.concatenate([[0], np.cumsum(count)])
    values = np.empty(start[-1])
    for length in np.unique(count):
        chosen = np.flatnonzero(count == length)
        joint = _joint_covariance(covariance, int(length))
        for part in np.array_split(chosen, max(1, -(-len(chosen) // CHUNK))):
            estimate = _conditional_mean(deviation, present, first[part], int(length), joint)
            values[start[part][:, None] + np.arange(length)] = estimate
    return values


def autocovariance(deviation: np.ndarray, present: np.ndarray, lags: int) -> np.ndarray | None:
    """Autocovariance (lags + 1,) from all pairs of present values; None where there are too few.

    Lags without pairs, and those beyond the end of the signal, count as uncorrelated.
    """
    # Imported here: it takes a tenth of a second to load, and only gaps need it.
    from scipy.fft import irfft, next_fast_len, rfft

    size = next_fast_len(len(deviation) + lags + 1, real=True)

    def products(values: np.ndarray) -> np.ndarray:
        return irfft(np.abs(rfft(values, size)) ** 2, size)[: lags + 1]

    pairs = np.round(products(present.astype(np.float64)))
    result = np.where(pairs >= MIN_PAIRS, products(deviation) / np.maximum(pairs, 1.0), 0.0)
    if not result[0] > 0.0:
        return None
    return result


def _on_the_line(signal: np.ndarray, first: np.ndarray, count: np.ndarray) -> np.ndarray:
    before, after = signal[first - 1], signal[first + count]
    share = (_place_within(count) + 1) / np.repeat(count + 1, count)
    return np.asarray(np.repeat(before, count) + share * np.repeat(after - before, count))


def _place_within(count: np.ndarray) -> np.ndarray:
    """0, 1, … of each gap, one gap after the other."""
    return np.asarray(np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count))


def _conditional_mean(
    deviation: np.ndarray, present: np.ndarray, first: np.ndarray, length: int, joint: np.ndarray
) -> np.ndarray:
    """Estimates (G, length) for gaps of equal length; `joint` as of `_joint_covariance`."""
    offset = np.concatenate([np.arange(-NEIGHBOURS, 0), np.arange(length, length + NEIGHBOURS)])
    position = first[:, None] + offset
    inside = (position >= 0) & (position < len(deviation))
    position = np.clip(position, 0, len(deviation) - 1)
    known = inside & present[position]
    span = np.arange(-NEIGHBOURS, length + NEIGHBOURS)
    outside = (span < 0) | (span >= length)
    between, towards = joint[np.ix_(outside, outside)], joint[np.ix_(~outside, outside)]
    values = np.where(known, deviation[position], 0.0)
    weights = np.empty_like(values)
    whole = known.all(axis=1)
    weights[whole] = np.linalg.solve(between, values[whole].T).T
    if not whole.all():
        weights[~whole] = solved_without(between, values[~whole], ~known[~whole])
    return np.where(known, weights, 0.0) @ towards.T


def solved_without(matrix: np.ndarray, values: np.ndarray, lacking: np.ndarray) -> np.ndarray:
    """Solutions (G, N) of the equations without those rows and columns that each of G lacks, 0 there.

    A few of N are lacking: with M the inverse of the whole matrix, that of the block that is left is
    M_kk − M_kl M_ll⁻¹ M_lk (of the block-wise inverse, Banachiewicz 1937), so that only as many equations as are
    lacking are solved for each.

    Parameters
    ----------
    matrix : (N, N) symmetric
    values : (G, N), 0 where lacking
    """
    inverse = np.linalg.inv(matrix)
    solved = values @ inverse
    number = lacking.sum(axis=1)
    for some in np.unique(number):
        rows = np.flatnonzero(number == some)
        columns = np.nonzero(lacking[rows])[1].reshape(len(rows), some)
        block = inverse[columns[:, :, None], columns[:, None, :]]
        of_lacking = np.linalg.solve(block, solved[rows[:, None], columns][:, :, None])
        solved[rows] -= np.matmul(inverse[columns].transpose(0, 2, 1), of_lacking)[:, :, 0]
    return solved


def _joint_covariance(covariance: np.ndarray, length: int) -> np.ndarray:
    """Covariance of the values in a gap and of its neighbours on both sides, in order of time."""
    span = np.arange(-NEIGHBOURS, length + NEIGHBOURS)
    return _possible(covariance[np.abs(span[:, None] - span[None, :])])


def _possible(matrix: np.ndarray) -> np.ndarray:
    """The nearest matrix that can be a covariance: estimated from pairs, it need not be one."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.maximum(values, RIDGE * matrix[0, 0])) @ vectors.T
