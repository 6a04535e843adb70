"""Least squares beside a disturbance that wanders: what an effect is worth while wind, barometer or heading drift.

    y_i = d_i·g + c_i·x(t_i) + e_i        e_i ~ N(0, σ²)

g are constants of the flight. x is a Gauss-Markov process of memory τ, or a walk where τ is infinite, between knots a
straight line. The ratio of its density to σ² (and τ, of those that are offered) is the likeliest after the constants
are taken out (restricted maximum likelihood; Patterson and Thompson, 1971, by the mixed-model equations of Henderson,
1950). All is one least-squares problem with a band of knots and a border of constants.

The model is never quite true, so beside the interval that it promises stands that of the jackknife over blocks of some
seconds (Tukey, 1958), each of which takes measurements and steps of the disturbance together. The wider one counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpbtrf, dpbtrs
from scipy.special import stdtrit

from fusetune.analyze.metrics.grouping import distinct, rows_of
from fusetune.analyze.smoothing.smoothed_velocity import NORMAL_QUARTILE

Array = npt.NDArray[np.float64]

BLOCK_S = 5.0
FEWEST_BLOCKS = 4
WALKS_FOR_EVER = math.inf
_RATIOS = 10.0 ** np.arange(-6.0, 3.0, 1.0)
"""Of the disturbance's growth in a second, squared, to the variance of a measurement: first look."""
_FINER = (0.5, 0.25, 0.125)
"""Powers of ten by which the search goes on."""
_FIRST_OF_WALK = 1e3
"""Standard deviation with which a walk begins, against the largest target: anywhere. It must not grow with the density
that is looked for, or a target far from 0, as an altitude above the sea, makes a large density the likeliest."""
_CONFIDENCE = 0.95
UNCERTAINTY = 1.25
"""Factor on all standard errors: ratio and memory are taken as known, and on made flights with known truth errors were
by so much larger than promised (docs/effects.md)."""
_ROUNDS = 2
_ROWS_AT_ONCE = 10_000
"""What is worked out for them takes some kilobytes each."""


@dataclass(frozen=True)
class WalkingRows:
    """Measurements with their regressors; N rows in any order, P constants, S wandering disturbances.

    Attributes
    ----------
    time_s : (N,)
    target : (N,) y
    design : (N, P) d
    walking : (N, S) c; none of them where S is 0
    expected : (P,) standard deviation around 0 that each constant has beforehand; infinite where nothing is known
    knots_s : from one knot to the next
    memories_s : the τ that are offered
    starts : (S,) standard deviation with which each walk begins; anything if None
    """

    time_s: Array
    target: Array
    design: Array
    walking: Array
    expected: Array
    knots_s: float = 1.0
    memories_s: Sequence[float] = (WALKS_FOR_EVER,)
    starts: Array | None = None


@dataclass(frozen=True)
class WalkingFit:
    """What was found.

    Attributes
    ----------
    constants : (P,) g
    standard_error : (P,) of it, the larger of what model and jackknife say
    freedom : (P,) degrees of freedom behind each
    noise : σ
    walk : growth of the disturbance in a second, standard deviation
    memory_s : τ
    knot_s : (M,) times of the knots
    course : (M, S) x at the knots
    promised : (P, P) covariance of the constants as the model has it, without any factor
    follows : (M, S, P) how far the course moves with each constant
    residual : (N,) e
    blocks : number of blocks with measurements
    """

    constants: Array
    standard_error: Array
    freedom: Array
    noise: float
    walk: float
    memory_s: float
    knot_s: Array
    course: Array
    promised: Array
    follows: Array
    residual: Array
    blocks: int
    ratio: float = field(default=0.0)

    def half_width(self, index: int) -> float:
        """Half of the 95 % interval of a constant."""
        return float(stdtrit(self.freedom[index], 0.5 + 0.5 * _CONFIDENCE) * self.standard_error[index])

    @cached_property
    def covariance(self) -> Array:
        """(P, P) of the constants, whose diagonal is that of `standard_error`."""
        stretched = self.standard_error / np.sqrt(np.maximum(np.diag(self.promised), 1e-300))
        return np.asarray(self.promised * np.outer(stretched, stretched))

    @cached_property
    def lag_one(self) -> float:
        """Correlation of neighbouring residuals; near 0 where the model holds."""
        one, other = self.residual[:-1], self.residual[1:]
        return float(one @ other / max(float(self.residual @ self.residual), 1e-30))


def fit_walking(rows: WalkingRows, like: WalkingFit | None = None, *, refined: bool = False) -> WalkingFit | None:
    """Solve; None with too few rows or blocks.

    Parameters
    ----------
    like : an earlier fit, whose ratio and memory are taken
    refined : whether these are only where the search begins
    """
    equations = _Equations.of(rows)
    if equations is None:
        return None
    if like is None:
        ratio, memory_s = _likeliest(equations, rows)
    else:
        ratio, memory_s = like.ratio, like.memory_s
        if refined and rows.walking.shape[1]:
            score = equations.solved(ratio, memory_s).score
            _, ratio = _finest(equations, score, math.log10(ratio), memory_s)
    for _ in range(_ROUNDS):
        equations = replace(equations, scale=equations.solved(ratio, memory_s).noise)
    return equations.solved(ratio, memory_s).fit()


def log_information(rows: WalkingRows, like: WalkingFit) -> float:
    """Logarithm of the determinant of what rows and prior tell of the course, in units of the variance of `like`.

    Where the columns c depend on constants, these are the likeliest only with half of it counted (Laplace's
    approximation of the likelihood without the course): a large c makes the same course cheaper.
    """
    equations = _Equations.of(rows)
    if equations is None:
        return 0.0
    return equations.solved(like.ratio, like.memory_s).log_information


def _likeliest(equations: _Equations, rows: WalkingRows) -> tuple[float, float]:
    if not rows.walking.shape[1]:
        return 1.0, WALKS_FOR_EVER
    best, found = math.inf, (1.0, WALKS_FOR_EVER)
    for memory in rows.memories_s:
        scores = [equations.solved(one, memory).score for one in _RATIOS]
        place = int(np.argmin(scores))
        score, ratio = _finest(equations, scores[place], math.log10(_RATIOS[place]), memory)
        if score < best:
            best, found = score, (ratio, memory)
    return found


def _finest(equations: _Equations, score: float, exponent: float, memory_s: float) -> tuple[float, float]:
    """The best score and ratio around a power of ten."""
    for step in _FINER:
        centre = exponent
        for side in (centre - step, centre + step):
            tried = equations.solved(10.0**side, memory_s).score
            if tried < score:
                score, exponent = tried, side
    return score, 10.0**exponent


@dataclass(frozen=True)
class _Equations:
    """Sums over the measurements, in units in which σ is `scale`."""

    rows: WalkingRows
    scale: float
    left: npt.NDArray[np.int64]
    share: Array
    knot_s: Array
    block: npt.NDArray[np.int64]
    band: Array
    border: Array
    corner: Array

    @property
    def anywhere(self) -> Array:
        """(S,) variances with which walks begin of which nothing is known."""
        size = np.sqrt(np.mean(np.square(self.rows.walking), axis=0))
        largest = max(float(np.max(np.abs(self.rows.target))), self.scale)
        return np.square(_FIRST_OF_WALK * largest / (np.maximum(size, 1e-9) * self.scale))

    @classmethod
    def of(cls, rows: WalkingRows) -> _Equations | None:
        states = rows.walking.shape[1]
        if rows.target.size < rows.design.shape[1] + 10:
            return None
        block = np.floor((rows.time_s - rows.time_s.min()) / BLOCK_S).astype(np.int64)
        if distinct(block).size < FEWEST_BLOCKS:
            return None
        begin, end = float(rows.time_s.min()), float(rows.time_s.max())
        pieces = max(1, math.ceil((end - begin) / rows.knots_s))
        place = np.minimum((rows.time_s - begin) / rows.knots_s, pieces - 1e-9)
        left = place.astype(np.int64)
        share: Array = np.asarray(place - left, np.float64)
        sights = np.column_stack([rows.design, -rows.target])
        band, border = np.zeros((2 * states, (pieces + 1) * states)), np.zeros(((pieces + 1) * states, sights.shape[1]))
        weights = ((left, 1.0 - share), (left + 1, share))
        for one in range(states):
            for knot, weight in weights:
                for column in range(sights.shape[1]):
                    summed = np.bincount(knot, weight * rows.walking[:, one] * sights[:, column], pieces + 1)
                    border[one::states, column] += summed
            for other in range(one + 1):
                product = rows.walking[:, one] * rows.walking[:, other]
                for knot, weight in weights:
                    band[one - other, other::states] += np.bincount(knot, weight * weight * product, pieces + 1)
            for other in range(states):
                product = share * (1.0 - share) * rows.walking[:, one] * rows.walking[:, other]
                band[states + one - other, other::states] += np.bincount(left, product, pieces + 1)
        # of the difference of two; what the constants are expected to be is weighed by it until σ itself is known
        scale = max(float(np.median(np.abs(np.diff(rows.target)))) / (math.sqrt(2.0) * NORMAL_QUARTILE), 1e-9)
        knots: Array = np.asarray(begin + rows.knots_s * np.arange(pieces + 1), np.float64)
        return cls(rows, scale, left, share, knots, block, band, border, sights.T @ sights)

    def solved(self, ratio: float, memory_s: float) -> _Solved:
        return _Solved(self, ratio, memory_s)


class _Solved:
    """The equations with what the disturbance and the constants are expected to do."""

    def __init__(self, given: _Equations, ratio: float, memory_s: float) -> None:
        self.given, self.ratio, self.memory_s = given, ratio, memory_s
        rows, knots = given.rows, given.knot_s.size
        self.states = states = rows.walking.shape[1]
        step = rows.knots_s
        self.kept = 0.0 if memory_s <= 0.0 else math.exp(-step / memory_s)
        if math.isinf(memory_s):
            self.gained = ratio * step
            self.first = given.anywhere
            if rows.starts is not None:
                self.first = np.minimum(self.first, np.square(rows.starts / given.scale))
        else:
            stationary = 0.5 * ratio * memory_s
            self.gained, self.first = stationary * (1.0 - self.kept**2), np.full(states, stationary)
        band = given.band.copy()
        expected = np.square(given.scale / rows.expected)
        corner = given.corner.copy()
        corner[:-1, :-1] += np.diag(expected)
        self.log_information = log_determinant = 0.0
        if states:
            band[0, states:] += 1.0 / self.gained
            band[0, :-states] += self.kept**2 / self.gained
            band[states, :-states] -= self.kept / self.gained
            band[0, :states] += 1.0 / self.first
            # as LAPACK has it: it is asked for hundreds of times, and what lies around it takes longer
            factor, info = dpbtrf(band, lower=1)
            if info:
                raise np.linalg.LinAlgError(f"the equations are not positive definite, from row {info} on")
            self.projected = dpbtrs(factor, given.border, lower=1)[0]
            corner -= np.einsum("ki,kj->ij", given.border, self.projected)
            self.log_information = log_determinant = 2.0 * float(np.sum(np.log(factor[0])))
            log_determinant += states * (knots - 1) * math.log(self.gained) + float(np.sum(np.log(self.first)))
        else:
            self.projected = np.zeros((0, corner.shape[0]))
        self.normal = corner[:-1, :-1]
        self.covariance = np.linalg.pinv(self.normal, hermitian=True)
        self.constants: Array = -self.covariance @ corner[:-1, -1]
        self.cost = float(corner[-1, -1] + corner[-1, :-1] @ self.constants)
        self.freedom = max(rows.target.size - int(np.count_nonzero(~np.isfinite(rows.expected))), 1)
        self.noise = math.sqrt(max(self.cost, 1e-300) / self.freedom)
        sign, determinant = np.linalg.slogdet(self.normal)
        self.score = self.freedom * math.log(max(self.cost, 1e-300)) + log_determinant
        self.score += float(determinant) if sign > 0 else 0.0

    def fit(self) -> WalkingFit:
        given, rows = self.given, self.given.rows
        # x of the least squares for any constants: -(projected g), the last column that of the 1
        course = -(self.projected[:, :-1] @ self.constants + self.projected[:, -1])
        course = course.reshape(given.knot_s.size, self.states)
        net, residual = self._net_rows(course)
        promised = self.noise * np.sqrt(np.diag(self.covariance))
        spread, blocks = self._jackknife(net, residual)
        wider = spread > promised
        errors = UNCERTAINTY * np.where(wider, spread, promised)
        return WalkingFit(
            constants=self.constants,
            standard_error=errors,
            freedom=np.where(wider, float(blocks - 1), float(self.freedom)),
            noise=self.noise,
            walk=self.noise * math.sqrt(self.ratio) if self.states else 0.0,
            memory_s=self.memory_s,
            knot_s=given.knot_s,
            course=course,
            promised=np.asarray(self.noise**2 * self.covariance, np.float64),
            follows=-self.projected[:, :-1].reshape(given.knot_s.size, self.states, self.constants.size),
            residual=residual[: rows.target.size],
            blocks=blocks,
            ratio=self.ratio,
        )

    def _net_rows(self, course: Array) -> tuple[Array, Array]:
        """Regressors less what the disturbance takes of them, and residuals: of measurements, then of its steps."""
        given, rows, states = self.given, self.given.rows, self.states
        parameters = rows.design.shape[1]
        if not states:
            return rows.design, rows.target - rows.design @ self.constants
        takes = -self.projected[:, :-1].reshape(-1, states, parameters)
        left, right = (1.0 - given.share)[:, None], given.share[:, None]

        def seen(values: Array) -> Array:
            flat = values.reshape(values.shape[0], states, -1)
            found: Array = np.empty((given.left.size, flat.shape[2]))
            for first in range(0, given.left.size, _ROWS_AT_ONCE):
                some = slice(first, first + _ROWS_AT_ONCE)
                knot = given.left[some]
                between = left[some, :, None] * flat[knot] + right[some, :, None] * flat[knot + 1]
                found[some] = np.einsum("ns,nsp->np", rows.walking[some], between)
            return found

        net = rows.design + seen(takes)
        residual = rows.target - rows.design @ self.constants - seen(course)[:, 0]
        scale = 1.0 / math.sqrt(self.gained)
        steps = (takes[1:] - self.kept * takes[:-1]).reshape(-1, parameters) * scale
        moved = -(course[1:] - self.kept * course[:-1]).ravel() * scale
        return np.vstack([net, steps]), np.concatenate([residual, moved])

    def _jackknife(self, net: Array, residual: Array) -> tuple[Array, int]:
        given = self.given
        later = given.knot_s[1:] - given.knot_s[0]
        of_steps = np.repeat(np.floor(later / BLOCK_S).astype(np.int64), self.states)
        block = np.concatenate([given.block, np.minimum(of_steps, given.block.max())])
        parts = [(net[own], residual[own]) for own in rows_of(block, distinct(given.block))]
        without = np.linalg.pinv(np.stack([self.normal - part.T @ part for part, _ in parts]), hermitian=True)
        changes = [one @ (part.T @ left) for one, (part, left) in zip(without, parts, strict=True)]
        count = len(changes)
        spread = np.var(np.array(changes), axis=0) * (count - 1)
        return np.sqrt(spread), count
