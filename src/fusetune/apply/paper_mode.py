"""The decision as the paper makes it, for comparison: lowest aggregate RMS of position and velocity innovations.

García, Molina, Trincado, "Real evaluation for designing sensor fusion in UAV platforms". It ranks one flight per
set, and a set that follows wandering measurements profits, so it stands beside the decision and never makes it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

PAPER_VARIABLES = {
    "pos_x": (("gnss_pos", "x"),),
    "pos_y": (("gnss_pos", "y"),),
    "pos_z": (("gnss_hgt", "x"), ("baro_hgt", "x")),
    "vel_x": (("gnss_vel", "x"),),
    "vel_y": (("gnss_vel", "y"),),
    "vel_z": (("gnss_vel", "z"),),
    "mag_x": (("mag", "x"),),
    "mag_y": (("mag", "y"),),
    "mag_z": (("mag", "z"),),
}
"""Variable of the paper's table 12 → the source and axis that show it, the first that a flight has."""

_POSITION = ("pos_x", "pos_y", "pos_z")
_VELOCITY = ("vel_x", "vel_y", "vel_z")
_AGGREGATED = (*_POSITION, *_VELOCITY)


@dataclass(frozen=True)
class PaperEntry:
    """One set as the paper sees it.

    Attributes
    ----------
    aggregate_rms : position and velocity together
    consistent : mean NIS within its two-sided χ² bounds; None where unknown
    break_rate : of all fused observations
    """

    name: str
    aggregate_rms: float
    consistent: bool | None = None
    break_rate: float = 0.0


def aggregate_rms(rms: Mapping[str, float]) -> float:
    """Root of the summed squares of the position and velocity RMS; NaN where one is missing.

    The paper's own aggregate row follows from its other rows by no rule that it states; where a table brings that
    row, take it as it is.
    """
    return _root_sum(rms, _AGGREGATED)


def _root_sum(rms: Mapping[str, float], names: Sequence[str]) -> float:
    return math.sqrt(sum(rms.get(name, math.nan) ** 2 for name in names))


def paper_ranking(entries: Sequence[PaperEntry]) -> list[PaperEntry]:
    """Order sets as the paper does: consistent ones first where any is, then by aggregate RMS, then by break rate."""
    any_consistent = any(entry.consistent for entry in entries)

    def key(entry: PaperEntry) -> tuple[bool, bool, float, float, str]:
        inconsistent = any_consistent and entry.consistent is False
        missing = math.isnan(entry.aggregate_rms)
        return inconsistent, missing, 0.0 if missing else entry.aggregate_rms, entry.break_rate, entry.name

    return sorted(entries, key=key)


@dataclass(frozen=True)
class PaperView:
    """What the paper's rule looks at in one set, over all scored flights.

    Attributes
    ----------
    position_rms, velocity_rms : root of the summed squares of the mean RMS of their variables, m and m/s
    flight_rms : aggregate RMS of each flight
    relative_nis : mean NIS of GNSS velocity divided by its expectation; NaN where unknown
    flights_inside, flights : on how many flights that lies inside the paper's two-sided χ² bounds
    """

    name: str
    position_rms: float
    velocity_rms: float
    flight_rms: Mapping[str, float]
    relative_nis: float
    flights_inside: int
    flights: int

    @property
    def aggregate_rms(self) -> float:
        return math.hypot(self.position_rms, self.velocity_rms)

    @property
    def is_consistent(self) -> bool:
        return self.flights > 0 and 2 * self.flights_inside >= self.flights


def paper_view(name: str, flights: Sequence[str], metrics: pa.Table) -> PaperView:
    """Gather what the paper's rule looks at.

    Parameters
    ----------
    flights : names of the scored flights
    metrics : the figures of all flights (columns of `METRICS_SCHEMA`)
    """
    kept = metrics.filter(
        pc.and_(pc.equal(metrics["set"], name), pc.is_in(metrics["flight"], value_set=pa.array(flights, pa.string())))
    )
    rms = kept.filter(pc.equal(kept["metric"], "rms_innovation")).to_pylist()
    values = {(row["flight"], row["source"], row["axis"]): row["value"] for row in rms}
    by_variable = {variable: _by_flight(places, flights, values) for variable, places in PAPER_VARIABLES.items()}
    means = {variable: float(np.mean(list(found.values()))) for variable, found in by_variable.items() if found}
    nis = [
        row
        for row in kept.filter(pc.equal(kept["metric"], "mean_nis")).to_pylist()
        if row["source"] == "gnss_vel" and row["axis"] == "all"
    ]
    return PaperView(
        name=name,
        position_rms=_root_sum(means, _POSITION),
        velocity_rms=_root_sum(means, _VELOCITY),
        flight_rms={
            flight: aggregate_rms({variable: found.get(flight, math.nan) for variable, found in by_variable.items()})
            for flight in flights
        },
        relative_nis=float(np.mean([row["value"] for row in nis])) / len(_VELOCITY) if nis else math.nan,
        flights_inside=sum(row["lower"] <= row["value"] <= row["upper"] for row in nis),
        flights=len(nis),
    )


def _by_flight(
    places: Sequence[tuple[str, str]], flights: Sequence[str], values: Mapping[tuple[str, str, str], float]
) -> dict[str, float]:
    """Values of the first place that any flight has."""
    for place in places:
        found = {flight: values[flight, *place] for flight in flights if (flight, *place) in values}
        if found:
            return found
    return {}


@dataclass(frozen=True)
class Gap:
    """By how much the logarithm of a prediction error of the paper's set exceeds that of the decision's set."""

    difference: float
    lower: float
    upper: float

    @property
    def is_certain(self) -> bool:
        return self.lower > 0.0 or self.upper < 0.0


@dataclass(frozen=True)
class Disagreement:
    """The paper's first set and the decision's set, and how they differ.

    Attributes
    ----------
    any_consistent : whether any set's mean NIS lies inside the paper's bounds on half of the flights at least
    aided, unaided, score : the paper's set against the decision's; None where no flight tells
    position_white_share : how white the error of GNSS position is; NaN where unknown
    objections : why the decision may not choose the paper's set, in words; empty where it may
    confidence : level of the intervals
    """

    first: PaperView
    chosen: PaperView
    any_consistent: bool
    aided: Gap | None
    unaided: Gap | None
    score: Gap | None
    position_white_share: float
    objections: Sequence[str]
    confidence: float


WANDERING = 0.6
"""A source whose error is less white than this rewards a filter for following it."""


def reasons(case: Disagreement) -> list[str]:
    """Why the paper's rule and the decision choose different sets, a sentence each, from the figures of the flights."""
    found = [f"The paper's rule takes “{case.first.name}”, the decision is “{case.chosen.name}”."]
    found += _why_the_paper_prefers(case)
    for gap, where in (
        (case.aided, "One step ahead, with all sensors in use"),
        (case.unaided, "After seconds without GNSS"),
        (case.score, "Both taken together, as the decision weighs them"),
    ):
        if gap is not None:
            found.append(_prediction(where, gap, case))
    if case.objections:
        found.append(f"“{case.first.name}” is not eligible: {'; '.join(case.objections)}.")
    elif case.score is not None and not case.score.is_certain:
        found.append("So the flights do not tell the two apart, which the paper's rule, without an interval, cannot see.")
    return found


def _why_the_paper_prefers(case: Disagreement) -> list[str]:
    first, chosen = case.first, case.chosen
    if not (math.isfinite(first.aggregate_rms) and math.isfinite(chosen.aggregate_rms)):
        return [f"The innovations of “{chosen.name}” do not cover position and velocity, so the paper cannot rank it."]
    if first.aggregate_rms > chosen.aggregate_rms:
        return [
            f"“{chosen.name}” has the smaller innovations (aggregate RMS {chosen.aggregate_rms:.3g} against "
            f"{first.aggregate_rms:.3g}), but its mean NIS lies inside the paper's χ² bounds on "
            f"{chosen.flights_inside} of {chosen.flights} flights only, that of “{first.name}” on "
            f"{first.flights_inside} of {first.flights}."
        ]
    return [*_smaller_innovations(case), *_consistency(case)]


def _smaller_innovations(case: Disagreement) -> list[str]:
    first, chosen = case.first, case.chosen
    lower = sum(first.flight_rms[name] < chosen.flight_rms[name] for name in first.flight_rms)
    parts = {
        "position and height": (first.position_rms, chosen.position_rms),
        "velocity": (first.velocity_rms, chosen.velocity_rms),
    }
    main, other = sorted(parts, key=lambda name: parts[name][0] ** 2 - parts[name][1] ** 2)
    sentences = [
        f"It has the lower aggregate RMS, {first.aggregate_rms:.3g} against {chosen.aggregate_rms:.3g} "
        f"({_change(first.aggregate_rms, chosen.aggregate_rms)}; lower on {lower} of {len(first.flight_rms)} flights), "
        f"mostly by its {main} innovations ({_change(*parts[main])}; {other} {_change(*parts[other])})."
    ]
    if main != "velocity" and case.position_white_share < WANDERING:
        sentences.append(
            f"Only {100.0 * case.position_white_share:.0f} % of the GNSS position error is white: a filter that follows "
            "the rest has smaller innovations without knowing its position better."
        )
    return sentences


def _consistency(case: Disagreement) -> list[str]:
    first, chosen = case.first, case.chosen
    if not math.isfinite(first.relative_nis):
        return []
    if not case.any_consistent:
        side = "below" if first.relative_nis < 1.0 else "above"
        return [
            f"The paper's χ² test cannot help: no set passes it (the mean NIS of “{first.name}” is "
            f"{first.relative_nis:.2g} times what it should be, {side} the bounds), so the RMS alone ranks them."
        ]
    if chosen.is_consistent:
        return []
    return [
        f"The mean NIS of “{chosen.name}” lies inside the paper's χ² bounds on {chosen.flights_inside} of "
        f"{chosen.flights} flights, that of “{first.name}” on {first.flights_inside} of {first.flights}; the bounds take "
        "samples as independent, which these are not."
    ]


def _prediction(where: str, gap: Gap, case: Disagreement) -> str:
    change, low, high = (100.0 * math.expm1(value) for value in (gap.difference, gap.lower, gap.upper))
    span = _minus(f"{case.confidence:.0%} interval {low:+.1f} % to {high:+.1f} %")
    size = f"{abs(change):.1f} % {'larger' if change >= 0.0 else 'smaller'}"
    chance = "" if gap.is_certain else ", which may be chance"
    return f"{where}, its errors are {size} than those of “{case.chosen.name}” ({span}){chance}."


def _change(value: float, base: float) -> str:
    return _minus(f"{100.0 * (value / base - 1.0):+.1f} %")


def _minus(text: str) -> str:
    return text.replace("-", "−")
