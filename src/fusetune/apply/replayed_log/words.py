"""A replayed log in words and a table: the answer first."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fusetune.apply.replayed_log.comparison import AGREES_WITHIN, ParameterBetween, ReplayedLog
from fusetune.px4.aid_sources import AXES


def replayed_lines(found: ReplayedLog) -> Iterator[str]:
    """Whether it ran with what was asked, whether its errors changed as predicted, and the figures."""
    yield _answer(found)
    yield _parameters_line(found)
    for one in found.parameters:
        yield f"  {_parameter(one)}"
    yield (
        f"  {'innovations':<16}{'samples':>8}{'RMS before':>12}{'after':>10}{'change':>9}{'predicted':>11}"
        f"{'NIS before':>12}{'after':>8}{'rejected':>10}{'after':>8}{'ours - PX4':>12}"
    )
    for axis in found.errors:
        name = f"{axis.source}.{AXES[axis.axis]}"
        yield (
            f"  {name:<16}{axis.samples:>8}{axis.before:>12.4f}{axis.after:>10.4f}{axis.change:>+9.1%}"
            f"{axis.predicted_change:>+11.1%}{axis.nis_before:>12.2f}{axis.nis_after:>8.2f}"
            f"{axis.rejected_before:>10.1%}{axis.rejected_after:>8.1%}{axis.difference:>12.1%}"
            f"{'' if axis.agrees else '  differs'}"
        )


def _answer(found: ReplayedLog) -> str:
    apart = [one for one in found.errors if not one.agrees]
    median = float(np.median([one.difference for one in found.errors]))
    close = f"its innovations and ours differ by {median:.1%} of their size (median over {len(found.errors)} axes)"
    if not found.is_as_asked:
        return f"The replay did not run with what was asked, so it confirms nothing; {close}."
    if apart:
        return (
            f"PX4's replay does not bear out what was predicted on {len(apart)} of {len(found.errors)} axes, where "
            f"errors changed otherwise by more than {AGREES_WITHIN:.0%}; {close}."
        )
    return f"PX4's replay bears out what was predicted: errors changed as ours within {AGREES_WITHIN:.0%}; {close}."


def _parameters_line(found: ReplayedLog) -> str:
    if not found.parameters:
        return f"{found.replayed} ran with the same parameters of the estimator as {found.original}."
    return f"{found.replayed} against {found.original}, parameters of the estimator:"


def _parameter(one: ParameterBetween) -> str:
    text = f"{one.name} {_value(one.original)} -> {_value(one.replayed)}"
    if one.asked is None:
        return f"{text}"
    return f"{text}, as asked" if one.is_as_asked else f"{text}, asked was {_value(one.asked)}"


def _value(value: float | None) -> str:
    return "not logged" if value is None else f"{value:.6g}"
