"""What PX4 is told of each source's noise, and what the flights say of it.

The innovations of a filter cannot tell how noisy a source is where its noise R is told far wrong: the covariance of the
state is wrong with it, and E ν² − H P Hᵀ, which should be R, comes out below zero. So the error of the source is taken
from `fusetune.analyze.sensors.source_whiteness`, in which the filter has no part: white noise σ_w, and σ_c, which
wanders with a correlation time τ, as far as it does within the horizon H.

    σ_t² = σ_w² + σ_c²                                size of the error
    σ_e² = σ_w² + σ_c² max(1, 2 min(τ, H) / Δt)       what a filter, which takes errors for white, may have to be told

What of σ_c is the source's and what the inertial solution's cannot be told apart, so the interval of the size begins at
that of σ_w and ends at that of σ_t. A source whose error cannot be had so has only a bound: white noise is no larger
than the innovations.

Sizes are means over flights of logarithms of ratios to what was told; of σ_e², which single flights rate far apart, it
is the plain mean, so that the flights on which the source wanders count. It guards against telling too little: no
noise is proposed below σ_e, and where more is needed than was told, σ_t is proposed, which is proved. The scatter is
pooled with a prior one, so that a single flight has an interval, too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
from scipy.special import stdtrit

from fusetune.apply.candidates import Candidate
from fusetune.apply.settings import DecisionSettings
from fusetune.finding import Finding
from fusetune.px4.aid_sources import AID_SOURCES, AXES, AidSource
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS

Array = npt.NDArray[np.float64]

PRIOR_SCATTER, PRIOR_FREEDOM = 0.25, 4.0
"""Scatter of the logarithm of an estimated noise between flights that are alike, and for how many flights it stands:
on simulated flights it is 0.01 to 0.1, of what wanders slowly up to 0.5."""
ESTIMATOR_ERROR = 0.15
"""By how much, in logarithm, the estimate itself can be off on any number of flights, found there as well."""
_METRICS = (
    "told_noise", "rms_innovation", "white_noise", "correlated_noise", "equivalent_noise", "error_correlation_s",
)  # fmt: skip
_RULES_WITHIN = 1.1
"""A parameter rules a noise that is at most so many times its own value; beyond, another figure does."""
_MOSTLY = 0.5 * math.log(2.0)
"""What wanders matters where it makes the wanted variance more than twice as large."""
_WORTH_A_TRY = 1.25
"""A value is proposed where it differs by this factor from the present one."""


@dataclass(frozen=True)
class SourceNoise:
    """Noise of one source over the flights, standard deviations of a horizontal axis in its unit.

    Attributes
    ----------
    told : what the estimator was told
    size : of the error, σ_t; with its interval `lower` to `upper`
    innovation : RMS of the innovations
    wanted : σ_e, as much as a filter may have to be told
    wanders_s : correlation time of what wanders; None where that hardly matters
    is_bound : whether only an upper bound of the noise is known, from the innovations
    parameter : that goes into it; None where none does
    now : value of the parameter
    rules : whether the parameter is what the estimator was told, and not a figure of the receiver
    """

    source: str
    flights: int
    told: float
    size: float
    lower: float
    upper: float
    innovation: float
    wanted: float
    wanders_s: float | None
    is_bound: bool
    parameter: str | None
    now: float | None
    rules: bool

    def is_smaller(self, factor: float) -> bool:
        """Whether the noise is beyond doubt so many times smaller than told; the innovations must not speak against."""
        return self.upper * factor < self.told and self.innovation < self.told

    def is_larger(self, factor: float) -> bool:
        """Whether it is so many times larger."""
        return not self.is_bound and self.lower > factor * self.told and self.innovation > self.told

    @property
    def value(self) -> float | None:
        """Of the parameter, for the estimator to be told what it may want, or, where it was told less than the size,
        that; within its range, to two digits."""
        if self.parameter is None or self.now is None:
            return None
        metadata = PARAMETERS[self.parameter]
        noise = self.size if self.size > self.told else max(self.wanted, self.size)
        low = -math.inf if metadata.minimum is None else metadata.minimum
        high = math.inf if metadata.maximum is None else metadata.maximum
        return min(max(float(f"{noise / _factor(AID_SOURCES[self.source]):.2g}"), low), high)


def source_noises(
    metrics: pa.Table, present: str, parameters: Mapping[str, float], settings: DecisionSettings
) -> list[SourceNoise]:
    """Noise of every source with a sensor, in the order of the table of aid sources.

    Parameters
    ----------
    metrics : figures of the flights that decide
    present : the set that flies now
    parameters : its values
    """
    figures = _by_flight(metrics, present)
    found = (
        _source_noise(AID_SOURCES[name], flights, parameters, settings.confidence) for name, flights in figures.items()
    )
    return [one for one in found if one is not None]


def consistency_findings(noises: Sequence[SourceNoise], settings: DecisionSettings) -> list[Finding]:
    """A finding for each source whose noise PX4 is told wrong beyond doubt, first those with a value to try, and of
    these the one that is furthest off."""
    off = [one for one in noises if _is_off(one, settings.noise_factor)]
    # first what something can be done about
    off.sort(key=lambda one: (proposed_value(one, noises) is None, -abs(math.log(one.size / one.told))))
    return [_finding(one, noises, settings) for one in off]


def consistency_candidates(noises: Sequence[SourceNoise], settings: DecisionSettings) -> list[Candidate]:
    """Sets to compare next: each noise parameter that is off as the flights want it, and all of them together."""
    found: list[Candidate] = []
    for parameter in dict.fromkeys(one.parameter for one in noises):
        off = [one for one in noises if one.parameter == parameter and _is_off(one, settings.noise_factor)]
        value = proposed_value(off[0], noises) if off else None
        if parameter is not None and value is not None:
            name = f"measured_{parameter.removeprefix('EKF2_').lower()}"
            found.append(Candidate(name, {parameter: value}, _said(off[0], settings)))
    if len(found) > 1:
        together = {name: value for one in found for name, value in one.overrides.items()}
        found.append(Candidate("measured_noises", together, "every noise as the flights show it"))
    return found


def proposed_value(noise: SourceNoise, noises: Iterable[SourceNoise]) -> float | None:
    """Value to try for the parameter of a source; None where none can help.

    A parameter that several sources share gets the largest value that one of them wants. What a receiver reports
    cannot be made smaller by a floor.
    """
    sharing = [one for one in noises if one.parameter == noise.parameter and one.value is not None]
    if noise.parameter is None or noise.now is None or noise.now <= 0.0 or not sharing:
        return None
    value = max(one.value or 0.0 for one in sharing)
    if noise.size > noise.told:
        return value if value > noise.now * _WORTH_A_TRY else None
    return value if noise.rules and 0.0 < value * _WORTH_A_TRY < noise.now else None


def sentence_of_largest(findings: Sequence[Finding]) -> str:
    """For the paragraph: the noise that is furthest off."""
    if not findings:
        return ""
    more = len(findings) - 1
    others = f" ({more} more below)" if more else ""
    return f"Beside the choice of a set: {findings[0].found}{others}."


def _is_off(noise: SourceNoise, factor: float) -> bool:
    return noise.is_smaller(factor) or noise.is_larger(factor)


def _finding(noise: SourceNoise, noises: Sequence[SourceNoise], settings: DecisionSettings) -> Finding:
    smaller = noise.size < noise.told
    value = proposed_value(noise, noises)
    evidence: dict[str, bool | int | float | str] = {
        "source": noise.source,
        "told": noise.told,
        "lower": noise.lower,
        "upper": noise.upper,
        "wanted": noise.wanted,
        "flights": noise.flights,
        "is_bound": noise.is_bound,
    }
    if noise.parameter is not None:
        evidence["parameter"] = noise.parameter
    if value is not None:
        evidence["proposed"] = value
    return Finding(
        f"told_noise_{noise.source}",
        "note" if smaller else "warning",
        _said(noise, settings),
        _remedy(noise, value),
        figure=noise.size,
        threshold=noise.told / settings.noise_factor if smaller else noise.told * settings.noise_factor,
        unit=AID_SOURCES[noise.source].unit,
        evidence=evidence,
    )


def _said(noise: SourceNoise, settings: DecisionSettings) -> str:
    source = AID_SOURCES[noise.source]
    times, worse = (
        (noise.told / noise.size, "worse") if noise.size < noise.told else (noise.size / noise.told, "better")
    )
    flights = "1 flight shows" if noise.flights == 1 else f"{noise.flights} flights show"
    span = f"{settings.confidence:.0%} interval {noise.lower:.2g} to {noise.upper:.2g}"
    shown = (
        f"the innovations leave at most {noise.upper:.2g} {source.unit}"
        if noise.is_bound
        else f"{flights} {noise.size:.2g} {source.unit} ({span})"
    )
    least = "at least " if noise.is_bound else ""
    return (
        f"PX4 is told that the {source.label} is {least}{times:.2g} times {worse} than it is: {noise.told:.2g} "
        f"{source.unit}, where {shown}"
    )


def _remedy(noise: SourceNoise, value: float | None) -> str:
    name = noise.parameter
    if name is None:
        return "No parameter says how noisy it is"
    wanders = ""
    if noise.wanders_s is not None:
        unit = AID_SOURCES[noise.source].unit
        wanders = (
            f"; part of its error wanders for some {noise.wanders_s:.2g} s, and a filter, which takes it for white, "
            f"may have to be told as much as {noise.wanted:.2g} {unit}"
        )
    if value is not None:
        return f"Compare {name} = {value:g} in a study before flying it (now {noise.now:g}){wanders}"
    if noise.size > noise.told:
        return f"{name} cannot make up for it within its range"
    if not noise.rules:
        others = AID_SOURCES[noise.source].noise_parameters[1:]
        if others:
            return f"Lowering {name} changes little: {' and '.join(others)} makes up more of what PX4 takes"
        return f"Lowering {name} changes nothing: what the sensor itself reports is larger, and rules"
    if noise.value is not None and noise.now is not None and noise.value * _WORTH_A_TRY >= noise.now:
        return f"Leave {name} as it is{wanders}"
    return f"Leave {name} as it is: it is that of another source, too, which is noisier"


def _by_flight(metrics: pa.Table, present: str) -> dict[str, list[dict[tuple[str, str], float]]]:
    """Source → for each flight that fused it the figures by metric and axis."""
    rows = metrics.filter(
        pc.and_(pc.equal(metrics["set"], present), pc.is_in(metrics["metric"], value_set=pa.array(_METRICS)))
    )
    found: dict[str, dict[str, dict[tuple[str, str], float]]] = {}
    names = ("flight", "source", "axis", "metric", "value")
    for flight, source, axis, metric, value in zip(*(rows[name].to_pylist() for name in names), strict=True):
        if axis in AXES and source in AID_SOURCES:
            found.setdefault(source, {}).setdefault(flight, {})[metric, axis] = value
    return {
        name: [found[name][flight] for flight in sorted(found[name])]
        for name, source in AID_SOURCES.items()
        if name in found and source.sensor
    }


@dataclass(frozen=True)
class _OneFlight:
    """Logarithms of ratios to what was told, means over the axes."""

    told: float
    white: float
    size: float
    wanted: float
    innovation: float
    wanders_s: float | None
    is_bound: bool


def _source_noise(
    source: AidSource,
    flights: Sequence[Mapping[tuple[str, str], float]],
    parameters: Mapping[str, float],
    confidence: float,
) -> SourceNoise | None:
    known = [one for figures in flights if (one := _of_flight(source, figures)) is not None]
    # where some flights show the error itself, those that only bound it say nothing more
    used = [one for one in known if not one.is_bound] or known
    if not used:
        return None
    told = math.exp(_mean(used, "told"))
    size, reach = _mean(used, "size"), _reach([one.size for one in used], confidence)
    white = _mean(used, "white")
    lower = white - _reach([one.white for one in used], confidence) if math.isfinite(white) else -math.inf
    wanted = _root_mean_square(used)
    wandering = [one.wanders_s for one in used if one.wanders_s is not None and wanted > size + _MOSTLY]
    parameter = next(iter(source.noises), None)
    now = parameters.get(parameter) if parameter is not None else None
    return SourceNoise(
        source=source.name,
        flights=len(used),
        told=told,
        size=told * math.exp(size),
        lower=told * math.exp(lower),
        upper=told * math.exp(size + reach),
        innovation=told * math.exp(_mean(used, "innovation")),
        wanted=told * math.exp(wanted),
        wanders_s=float(np.median(wandering)) if wandering else None,
        is_bound=used[0].is_bound,
        parameter=parameter if now is not None else None,
        now=now,
        rules=now is not None and told <= _RULES_WITHIN * _factor(source) * now,
    )


def _of_flight(source: AidSource, figures: Mapping[tuple[str, str], float]) -> _OneFlight | None:
    """Of one flight; None where nothing is known of one of the axes."""
    axes = [one for axis in AXES[: source.axes] if (one := _of_axis(source, figures, axis)) is not None]
    if len(axes) != source.axes:
        return None
    bound = any(one.is_bound for one in axes)
    wandering = [] if bound else [one.wanders_s for one in axes if one.wanders_s is not None]
    return _OneFlight(
        told=axes[0].told,
        white=-math.inf if bound else _mean(axes, "white"),
        size=_mean(axes, "innovation" if bound else "size"),
        wanted=_mean(axes, "innovation") if bound else _root_mean_square(axes),
        innovation=_mean(axes, "innovation"),
        wanders_s=float(np.median(wandering)) if wandering else None,
        is_bound=bound,
    )


def _of_axis(source: AidSource, figures: Mapping[tuple[str, str], float], axis: str) -> _OneFlight | None:
    told, rms, white, wander, wanted, tau = (figures.get((metric, axis), math.nan) for metric in _METRICS)
    if not (told > 0.0 and rms > 0.0):
        return None
    innovation, size = math.log(rms / told), math.hypot(white, wander)
    if not (size > 0.0 and wanted > 0.0):
        return _OneFlight(math.log(told), -math.inf, innovation, innovation, innovation, None, is_bound=True)
    return _OneFlight(
        told=math.log(told),
        white=math.log(white / told) if white > 0.0 else -math.inf,
        size=math.log(size / told),
        wanted=math.log(wanted / told),
        innovation=innovation,
        wanders_s=tau if wanted**2 > 2.0 * white**2 else None,
        is_bound=False,
    )


def _factor(source: AidSource) -> float:
    """What the parameter is multiplied with to give the noise of the source's first axis."""
    return source.noise_floors[0].factor if source.noise_floors else 1.0


def _mean(values: Sequence[_OneFlight], name: str) -> float:
    return float(np.mean([getattr(one, name) for one in values]))


def _root_mean_square(values: Sequence[_OneFlight]) -> float:
    """Logarithm of that of what is wanted."""
    return 0.5 * math.log(float(np.mean(np.exp([2.0 * one.wanted for one in values]))))


def _reach(values: Sequence[float], confidence: float) -> float:
    """Half the width of the interval of a mean (N,) of logarithms."""
    count = len(values)
    squares = PRIOR_FREEDOM * PRIOR_SCATTER**2 + float(np.sum(np.square(np.array(values) - np.mean(values))))
    freedom = PRIOR_FREEDOM + count - 1
    quantile = float(stdtrit(freedom, 0.5 + 0.5 * confidence))
    return quantile * math.sqrt(squares / freedom / count) + ESTIMATOR_ERROR
