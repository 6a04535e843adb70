"""What the sets tell of the parameters, as the files and the page have it."""

from __future__ import annotations

from dataclasses import dataclass

Floats = tuple[float, ...]
Ends = tuple[float, float]

MATTERS, FLAT, UNSURE, NOT_TOLD = "matters", "flat", "unsure", "not told"
"""What is said of a parameter."""


@dataclass(frozen=True)
class FitQuality:
    """How well the surface predicts sets that it was not made of.

    Attributes
    ----------
    kernel : name of the assumption that predicted best
    sets : different sets that it was made of, without the present one
    error : RMS error of the predicted mean difference of a set that was left out, nat
    explained : share of the variance between sets that it predicts; 0 or less is no better than their mean
    goes_through : it goes through what was tried, for the sets are too few to be left out
    """

    kernel: str
    sets: int
    error: float
    explained: float
    goes_through: bool


@dataclass(frozen=True)
class TradeOff:
    """Two parameters of which one makes up for the other.

    Attributes
    ----------
    first, second : parameters
    undone : share of the cost of moving the first that the second undoes, 0 … 1
    exponent : on logarithmic scales the second goes with this power of the first along the ridge; None otherwise
    slope : coordinates of the second per coordinate of the first along the ridge
    """

    first: str
    second: str
    undone: float
    exponent: float | None
    slope: float


@dataclass(frozen=True)
class Curve:
    """The score along one parameter, the others as the incumbent has them; differences to the present set, nat.

    Attributes
    ----------
    values : of the parameter, from end to end of what was tried
    differences : mean over the flights
    lower, upper : the ends of the interval of its change from the incumbent's value, there without width; empty where
        nothing shows the spread
    others_at_best : the same with the others at their best in the neighbourhood; empty where that is no other curve
    """

    values: Floats
    differences: Floats
    lower: Floats
    upper: Floats
    others_at_best: Floats


@dataclass(frozen=True)
class ParameterSensitivity:
    """What the flights say of one parameter.

    Attributes
    ----------
    parameter : its name
    scale : "log" or "linear"
    present, incumbent : its values
    tried : lowest and highest value that was tried
    verdict : "matters": within the neighbourhood the errors change by more than 1 % beyond doubt; "flat": they do not
        change by more than 1 % or one standard error, and surely not by more than 5 %; "unsure": neither; "not told":
        the sets do not tell its effect from that of others
    same_within : values around the incumbent's between which the errors change by less than 1 %, or less than one
        standard error; None where nothing is told
    at_bound : the best lies at the end of what was tried, and not at the present value, so that it is not determined
    change : the largest mean change of the score in the neighbourhood against the incumbent, nat
    possible : the largest that its interval holds; None where nothing shows that
    resolution : share of what could be along the parameter that the sets tell, 0 … 1
    first, total : Sobol indices in the neighbourhood, and their intervals; None where there are none
    curve : the score along it; None where nothing is told
    """

    parameter: str
    scale: str
    present: float
    incumbent: float
    tried: Ends
    verdict: str
    same_within: Ends | None
    at_bound: bool
    change: float
    possible: float | None
    resolution: float
    first: float | None
    total: float | None
    first_interval: Ends | None
    total_interval: Ends | None
    curve: Curve | None


@dataclass(frozen=True)
class TriedSet:
    """A set as the figures show it: values in the order of the parameters, mean difference over its flights in nat."""

    name: str
    values: Floats
    difference: float
    allowed: bool


@dataclass(frozen=True)
class Sensitivity:
    """What the sets tell of the parameters.

    Attributes
    ----------
    flights : number of flights
    confidence : of the intervals
    quality : how well the surface predicts sets that were left out; None where there is no surface
    spread : standard deviation of the score over the neighbourhood, nat; None where there is none
    parameters : in the order of the factors
    trade_offs : pairs, the strongest first
    tried : all sets
    """

    flights: int
    confidence: float
    quality: FitQuality | None
    spread: float | None
    parameters: tuple[ParameterSensitivity, ...]
    trade_offs: tuple[TradeOff, ...]
    tried: tuple[TriedSet, ...]

    def of_verdict(self, verdict: str) -> tuple[ParameterSensitivity, ...]:
        """Parameters of a verdict, those that change most first."""
        found = [one for one in self.parameters if one.verdict == verdict]
        return tuple(sorted(found, key=lambda one: -one.change))
