"""The score as a surface over the parameters' coordinates, for each flight and for their mean.

A Gaussian process with one of three kernels: the one that predicts left-out sets best. First a surface for the mean
over the flights, then for each flight its departures from that, so that sets that were tried on some of the flights
count where they were, and a flight with few sets is like the others where it says nothing else.

References
----------
Rasmussen and Williams, "Gaussian Processes for Machine Learning", MIT Press 2006: prediction (2.23-2.24), marginal
likelihood (5.8-5.9), leave-one-out errors in closed form (5.12).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from fusetune.apply.sensitivity.kernels import MAIN_EFFECTS, QUADRATIC, SMOOTH, Kernel
from fusetune.apply.sensitivity.result import FitQuality
from fusetune.apply.trials import Trials

Array = npt.NDArray[np.float64]

HOPELESS = 0.25
"""Nat. Sets that are worse by more than this (errors 28 % larger) count by the logarithm of the rest: how much worse a
hopeless set is must not shape the surface where it matters."""

_OF_ONE_FACTOR = 0.05
"""Nugget of a set that changes one factor, in a sum of effects: against that of sets that change several."""

_NO_DIRECTION = 1e-4
"""Of the largest eigenvalue: differences in such a direction are none that the kernel can follow."""

_WORTH = 1.05
"""A richer kernel has to predict better by this."""

_MOST_FOR_LENGTHS = 250
"""Lengths are found on so many of the sets, evenly among them: the time goes with the cube of their number."""

_NUGGETS = np.geomspace(1e-6, 1.0, 13)
_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Surface:
    """Differences to the present set, nat, hopeless ones compressed.

    Attributes
    ----------
    kernel : chosen assumption
    places : (N, P) coordinates of the sets it was made of
    weights : (N, F) of the kernel's columns, for each flight
    inverse : (N, N) of the kernel's matrix with its nugget
    amplitude : variance by which the kernel is multiplied
    roughness : standard deviation of what the kernel is too smooth for, nat
    quality : how well it predicts
    """

    kernel: Kernel
    places: Array
    weights: Array
    inverse: Array
    amplitude: float
    roughness: float
    quality: FitQuality

    def at(self, coordinates: Array) -> Array:
        """(M, F) differences to the present set at coordinates (M, P), on each flight."""
        return np.asarray(self.kernel(coordinates, self.places) @ self.weights)

    def mean_at(self, coordinates: Array) -> Array:
        """(M,) the same, mean over the flights."""
        return np.asarray(self.kernel(coordinates, self.places) @ self.weights.mean(axis=1))

    def uncertainty(self, coordinates: Array, reference: Array) -> Array:
        """(M,) standard deviation of the mean difference between places (M, P) and one of them (P,).

        It holds what no set near them tells, and how rough the score is: with no distance between two places that is
        the same at both, a unit of the coordinates apart it is not.
        """
        apart = np.square(coordinates - reference).sum(axis=1)
        rough = 2.0 * self.roughness**2 * -np.expm1(-0.5 * apart)
        return np.sqrt(self.amplitude * self._remaining(coordinates, reference)[0] + rough)

    def resolution(self, coordinates: Array, reference: Array) -> Array:
        """(M,) share of the prior variance of the same that the sets take away, 0 … 1."""
        remaining, prior = self._remaining(coordinates, reference)
        return 1.0 - np.divide(remaining, prior, out=np.zeros_like(prior), where=prior > 0.0)

    def _remaining(self, coordinates: Array, reference: Array) -> tuple[Array, Array]:
        """Variance of differences after and before the sets were seen, amplitude 1."""
        origin = reference[None, :]
        prior = self.kernel.variance(coordinates) + self.kernel.variance(origin)
        prior -= 2.0 * self.kernel(coordinates, origin)[:, 0]
        columns = self.kernel(coordinates, self.places) - self.kernel(origin, self.places)
        taken = np.sum(columns @ self.inverse * columns, axis=1)
        return np.maximum(prior - taken, 0.0), prior


def compressed(differences: Array) -> Array:
    """Differences of scores, hopeless ones nearer: beyond `HOPELESS` the logarithm goes on with the same slope."""
    beyond = np.maximum(differences / HOPELESS, 1.0)
    return np.where(differences > HOPELESS, HOPELESS * (1.0 + np.log(beyond)), differences)


def fit_surface(trials: Trials) -> Surface | None:
    """The surface of some trials; None where no set differs from the present one on any flight that it was tried on.

    Sets with the same values are taken once, as their mean.
    """
    places, differences = _different_sets(trials)
    if not len(places):
        return None
    reach = np.abs(places).max(axis=0)
    scales = np.where(reach > 1e-9, reach, 1.0)
    tried = np.isfinite(differences)
    mean = np.nanmean(differences, axis=1)
    candidates = [_fitted(kernel, places, mean, tried) for kernel in _kernels(places, scales, mean)]
    # one that assumes more has to predict better by as much
    _, best = min(enumerate(candidates), key=lambda one: one[1].quality.error * _WORTH ** one[0])
    return _with_flights(best, differences, tried)


def _different_sets(trials: Trials) -> tuple[Array, Array]:
    """Coordinates and compressed differences (N, F) of sets that are not the present one and were tried somewhere."""
    coordinates, differences = trials.coordinates, compressed(trials.differences)
    apart = np.any(np.abs(coordinates) > 1e-9, axis=1) & np.any(np.isfinite(differences), axis=1)
    if not apart.any():
        return coordinates[:0], differences[:0]
    _, first, group = np.unique(np.round(coordinates[apart], 9), axis=0, return_index=True, return_inverse=True)
    rows = [differences[apart][np.ravel(group) == index] for index in range(len(first))]
    with np.errstate(invalid="ignore"):
        means = [np.nansum(one, axis=0) / np.isfinite(one).sum(axis=0) for one in rows]
    order = np.argsort(first)
    return coordinates[apart][first][order], np.array(means)[order]


def _kernels(places: Array, scales: Array, mean: Array) -> list[Kernel]:
    """The assumptions that so many sets can tell apart: interactions from twice as many sets as a full quadratic has
    terms."""
    sets, factors = places.shape
    kernels = [Kernel(MAIN_EFFECTS, scales)]
    if factors > 1 and sets >= factors * (factors + 3):
        kernels.append(Kernel(QUADRATIC, scales))
    if sets >= factors * (factors + 3) and float(np.ptp(mean)) > 0.0:
        some = np.unique(np.linspace(0, sets - 1, min(sets, _MOST_FOR_LENGTHS)).round().astype(int))
        kernels.append(_likeliest_smooth(places[some], scales, mean[some]))
    return kernels


def _likeliest_smooth(places: Array, scales: Array, mean: Array) -> Kernel:
    """Lengths, size of the departures and nugget by maximum marginal likelihood, the amplitude taken out."""
    sets, factors = places.shape
    scaled = places / scales
    squares = [np.square(scaled[:, i][:, None] - scaled[:, i][None, :]) for i in range(factors)]
    own = [np.square(scaled[:, i]) for i in range(factors)]
    quadratic = Kernel(QUADRATIC, scales)(places, places)

    def negative(logs: Array) -> tuple[float, Array]:
        inverse_lengths, departure, nugget = np.exp(-2.0 * logs[:factors]), np.exp(logs[-2]), np.exp(logs[-1])
        near = np.exp(-0.5 * sum(w * square for w, square in zip(inverse_lengths, squares, strict=True)))
        at_origin = np.exp(-0.5 * sum(w * one for w, one in zip(inverse_lengths, own, strict=True)))
        pinned = np.outer(at_origin, at_origin)
        matrix = quadratic + departure * (near - pinned) + nugget * np.eye(sets)
        factor = cho_factor(matrix, lower=True)
        inverse = cho_solve(factor, np.eye(sets))
        solved = inverse @ mean
        amplitude = float(mean @ solved) / sets
        value = 0.5 * sets * np.log(amplitude) + float(np.log(np.diag(factor[0])).sum())
        sensitivity = 0.5 * (inverse - np.outer(solved, solved) / amplitude)
        slopes = [
            departure * w * float(np.sum(sensitivity * (near * square - pinned * np.add.outer(one, one))))
            for w, square, one in zip(inverse_lengths, squares, own, strict=True)
        ]
        slopes.append(departure * float(np.sum(sensitivity * (near - pinned))))
        slopes.append(nugget * float(np.trace(sensitivity)))
        # A weak prior keeps lengths at the size of what was tried where the sets say nothing of them.
        value += 0.5 * float(np.square(logs[:factors]).sum())
        return value, np.array(slopes) + np.concatenate([logs[:factors], np.zeros(2)])

    start = np.concatenate([np.zeros(factors), [0.0, np.log(1e-2)]])
    bounds = [(np.log(0.15), np.log(20.0))] * factors + [(np.log(1e-4), np.log(1e4)), (np.log(1e-7), np.log(10.0))]
    found = minimize(negative, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 80}).x
    # as far as it is determined, so that the last bits of a machine's arithmetic have no say
    found = np.round(found, 1)
    return Kernel(SMOOTH, scales, np.exp(found[:factors]), float(np.exp(found[-2])))


def _fitted(kernel: Kernel, places: Array, mean: Array, tried: npt.NDArray[np.bool_]) -> Surface:
    """The surface of the mean with the nugget that predicts left-out sets best.

    With no more sets than the kernel can follow, whatever their differences are, a left-out set cannot be predicted,
    and that tells nothing: the surface then goes through what was tried.
    """
    matrix = kernel(places, places)
    thin = tried.shape[1] / tried.sum(axis=1)
    if kernel.name == MAIN_EFFECTS:
        # what it lacks most are interactions, and a set that changes one factor has none
        thin = np.where(np.count_nonzero(places, axis=1) == 1, _OF_ONE_FACTOR * thin, thin)
    sizes = np.linalg.eigvalsh(matrix)
    tells = kernel.name != MAIN_EFFECTS or bool(sizes[0] < _NO_DIRECTION * sizes[-1])
    nuggets = sizes.mean() * (_NUGGETS if tells else _NUGGETS[:1])
    # (K + n T)⁻¹ = T^-½ Q (Λ + n)⁻¹ Qᵀ T^-½, with T^-½ K T^-½ = Q Λ Qᵀ: decomposed once for all nuggets
    root = 1.0 / np.sqrt(thin)
    decomposed, directions = np.linalg.eigh(root[:, None] * matrix * root)
    scaled, sizes_kept = root[:, None] * directions, np.maximum(decomposed, 0.0)
    fits = [_left_out_fit(scaled, sizes_kept + nugget, mean) for nugget in nuggets]
    index = int(np.argmin([fit[0] for fit in fits]))
    error, amplitude = fits[index]
    variance = float(np.var(mean))
    explained = 1.0 - error**2 / variance if variance > 0.0 else 0.0
    quality = FitQuality(kernel.name, len(mean), error, explained, not tells)
    inverse = _inverse(scaled, sizes_kept + nuggets[index])
    roughness = float(np.sqrt(amplitude * nuggets[index] * np.median(thin)))
    return Surface(kernel, places, (inverse @ mean)[:, None], inverse, amplitude, roughness, quality)


def _inverse(directions: Array, sizes: Array) -> Array:
    return np.asarray(directions / sizes @ directions.T)


def _left_out_fit(directions: Array, sizes: Array, mean: Array) -> tuple[float, float]:
    """RMS error of left-out sets, and the amplitude: what it says of its own errors agrees with those that it made.

    Of the inverse (`_inverse`) only what it makes of the mean and its diagonal are needed.
    """
    solved, precision = directions @ (directions.T @ mean / sizes), np.square(directions) @ (1.0 / sizes)
    left_out = solved / precision
    amplitude = max(float(mean @ solved) / len(mean), float(np.mean(np.square(left_out) * precision)))
    return float(np.sqrt(np.mean(np.square(left_out)))), amplitude


def _with_flights(surface: Surface, differences: Array, tried: npt.NDArray[np.bool_]) -> Surface:
    """The surface with the flights' departures from the mean."""
    matrix = surface.kernel(surface.places, surface.places)
    nugget = np.linalg.inv(surface.inverse) - matrix
    shared = surface.weights[:, 0]
    own = np.zeros(differences.shape)
    for _ in range(_ROUNDS):
        departures = differences - (matrix @ shared)[:, None]
        own = _departure_weights(matrix, departures, tried)
        # a set that was tried on some of the flights counts without what is special of these
        mean = np.nanmean(differences - matrix @ own, axis=1)
        shared = np.asarray(np.linalg.solve(matrix + nugget, mean), dtype=np.float64)
    return replace(surface, weights=shared[:, None] + own)


def _departure_weights(matrix: Array, departures: Array, tried: npt.NDArray[np.bool_]) -> Array:
    """(N, F) weights of each flight's departures, with the one nugget that predicts left-out ones best."""
    nuggets = float(np.trace(matrix)) / len(matrix) * _NUGGETS[2:]
    weights, squares = np.zeros((len(nuggets), *departures.shape)), np.zeros(len(nuggets))
    decomposed: dict[bytes, tuple[Array, Array]] = {}
    for flight, rows in enumerate(tried.T):
        if not rows.any():
            continue
        if rows.tobytes() not in decomposed:
            decomposed[rows.tobytes()] = np.linalg.eigh(matrix[np.ix_(rows, rows)])
        sizes, directions = decomposed[rows.tobytes()]
        along = directions.T @ departures[rows, flight]
        for index, nugget in enumerate(nuggets):
            shrunk = 1.0 / (np.maximum(sizes, 0.0) + nugget)
            solved = directions @ (shrunk * along)
            squares[index] += np.sum(np.square(solved / (np.square(directions) @ shrunk)))
            weights[index, rows, flight] = solved
    return np.asarray(weights[np.argmin(squares)])
