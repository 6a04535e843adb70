"""What matters, in words that a pilot understands."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from fusetune.apply.sensitivity.kernels import MAIN_EFFECTS
from fusetune.apply.sensitivity.result import (
    FLAT,
    MATTERS,
    NOT_TOLD,
    UNSURE,
    ParameterSensitivity,
    Sensitivity,
    TradeOff,
)
from fusetune.apply.wording import named

NOTHING_VARIED = "No set changes a parameter that has a scale, so nothing is told of how much parameters matter."
_MOST_RANGES = 4


def sentences(found: Sensitivity) -> tuple[str, ...]:
    """The answer first: what matters, what does not, what is not known, what trades off, and how far to trust it."""
    return tuple(_sentences(found))


def _sentences(found: Sensitivity) -> Iterator[str]:
    if all(one.verdict == NOT_TOLD for one in found.parameters):
        yield _nothing_told(found)
        return
    matter, flat, unsure = (found.of_verdict(verdict) for verdict in (MATTERS, FLAT, UNSURE))
    yield _what_matters(matter)
    if flat:
        yield _what_is_flat(flat)
    if unsure:
        yield _what_is_unsure(unsure)
    untold = [one.parameter for one in found.parameters if one.verdict == NOT_TOLD]
    if untold:
        yield (
            f"Nothing can be told of {listed(untold)}: the sets change {'it' if len(untold) == 1 else 'them'} together "
            "with others, and what one does is not seen apart from what the others do."
        )
    yield from _at_bounds(found)
    yield from (trade_off_sentence(one) for one in found.trade_offs)
    yield _trust(found)


def _nothing_told(found: Sensitivity) -> str:
    count = len({one.values for one in found.tried if _is_other(one.values, found)})
    sets = f"{count} different set{'s' if count != 1 else ''}"
    names = [one.parameter for one in found.parameters]
    return (
        f"Which parameter matters cannot be told: {sets} beside the present one change {listed(names)} together, so "
        "that what one does is not seen apart from what the others do. A study that changes one at a time would tell."
    )


def _is_other(values: Sequence[float], found: Sensitivity) -> bool:
    return any(value != one.present for value, one in zip(values, found.parameters, strict=True))


def _what_matters(matter: Sequence[ParameterSensitivity]) -> str:
    if not matter:
        return "No parameter is shown to matter near what flies now."
    largest = matter[0]
    verb = "matters" if len(matter) == 1 else "matter"
    size = _percent(largest.change)
    each = "" if len(matter) == 1 else f", most of all {largest.parameter}"
    return f"On these flights {listed([one.parameter for one in matter])} {verb}{each} (errors change by up to {size})."


def _what_is_flat(flat: Sequence[ParameterSensitivity]) -> str:
    told = [(one.parameter, one.same_within) for one in flat if one.same_within is not None]
    ranges = [f"{name} between {_number(ends[0])} and {_number(ends[1])}" for name, ends in told[:_MOST_RANGES]]
    more = len(told) - len(ranges)
    rest = f"; likewise {more} more, see the table" if more else ""
    return (
        f"Could be anything in this range: {listed(ranges)} (the errors change by less than 1 % there, or by less than "
        f"one standard error){rest}."
    )


def _what_is_unsure(unsure: Sequence[ParameterSensitivity]) -> str:
    names = listed([one.parameter for one in unsure])
    verb = "matters" if len(unsure) == 1 else "matter"
    possible = [one.possible for one in unsure if one.possible is not None]
    if not possible:
        return (
            f"Whether {names} {verb} one flight cannot show: errors change there by up to {_percent(unsure[0].change)}."
        )
    return (
        f"Whether {names} {verb} is not sure: errors change by up to {_percent(unsure[0].change)}, but for all that is "
        f"known it may be nothing, or as much as {_percent(max(possible))}."
    )


def _at_bounds(found: Sensitivity) -> Iterator[str]:
    """Parameters whose best value is not determined, as it lies at the end of what was tried."""
    bound = [one for one in found.parameters if one.at_bound and one.verdict in (MATTERS, UNSURE)]
    if bound:
        ends = [f"{one.parameter} at {_number(best_value(one))}" for one in bound]
        yield (
            f"The best lies at the end of what was tried for {listed(ends)}: "
            f"{'it is' if len(bound) == 1 else 'they are'} not determined, and the best may lie beyond."
        )


def best_value(one: ParameterSensitivity) -> float:
    """Value at which the curve of a parameter is lowest."""
    assert one.curve is not None, "a parameter of which something is told has a curve"
    return min(zip(one.curve.differences, one.curve.values, strict=True))[1]


def trade_off_sentence(one: TradeOff) -> str:
    """What the second parameter has to do when the first is moved."""
    both = f"{one.first} and {one.second} trade off"
    if one.exponent is None:
        return f"{both}: moving the second makes up for {100.0 * one.undone:.0f} % of what moving the first costs."
    return (
        f"{both}: {'their ratio' if one.exponent > 0.0 else 'their product'} matters more than each alone. With the "
        f"first doubled, the second times {_number(2.0**one.exponent)} undoes {100.0 * one.undone:.0f} % of what that "
        "costs."
    )


def _trust(found: Sensitivity) -> str:
    quality = found.quality
    assert quality is not None, "what is told of parameters comes from a surface"
    apart = " How parameters act together is not seen." if quality.kernel == MAIN_EFFECTS else ""
    if quality.goes_through:
        return f"From {quality.sets} sets each curve is a parabola through what was tried.{apart}"
    text = f"A set that was left out is predicted to within {_percent(quality.error)} (RMS; from {quality.sets} sets)."
    if quality.explained < 0.5:
        text += " That is little better than the mean of the others, so take the curves for a rough picture."
    return text + apart


def listed(names: Sequence[str]) -> str:
    """Names in a sentence, the last after "and", of many the first."""
    text = named(names)
    head, comma, last = text.rpartition(", ")
    return f"{head} and {last}" if comma and " and " not in last else text


def _percent(change: float) -> str:
    return f"{100.0 * math.expm1(change):.2g} %" if change < 1.0 else "more than 100 %"


def _number(value: float) -> str:
    return f"{value:.2g}" if abs(value) < 10.0 else f"{value:.0f}"
