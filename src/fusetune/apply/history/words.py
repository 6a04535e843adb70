"""A history in words, for the page and the command."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fusetune.apply.history.entries import DecisionEntry, Gain, History, OutcomeEntry
from fusetune.apply.wording import counted, named
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS

NOTHING_AFTER = "not yet known: no flight with it so far"
_INDENT = " " * 12


def history_lines(history: History) -> Iterator[str]:
    """Every decision, oldest first, with what became of it."""
    for entry in history.decisions:
        yield from _decision_lines(entry, history.outcome_of(entry))


def gain_words(gain: Gain) -> str:
    """A gain with its interval."""
    if gain.percent is None:
        return "not known"
    text = f"{abs(gain.percent):.1f} % {'smaller' if gain.percent >= 0.0 else 'larger'}"
    if gain.lower is None or gain.upper is None:
        return f"{text} (how far chance could do that is not known)"
    return f"{text} ({gain.confidence:.0%} interval {gain.lower:.1f} to {gain.upper:.1f} % smaller)"


def gain_in_short(gain: Gain) -> str:
    """By how much errors shrank, with the interval, for a table that says so."""
    if gain.percent is None:
        return "–"
    if gain.lower is None or gain.upper is None:
        return f"{gain.percent:.1f} %"
    return f"{gain.percent:.1f} % ({gain.lower:.1f} to {gain.upper:.1f})".replace("-", "−")


def outcome_words(outcome: OutcomeEntry | None) -> str:
    """The last word on a change."""
    if outcome is None:
        return NOTHING_AFTER
    against = {"less": ", less than predicted", "more": ", more than predicted"}.get(outcome.against_prediction, "")
    against = ", as predicted" if outcome.against_prediction == "as predicted" else against
    why = f": {'; '.join(outcome.objections)}" if outcome.objections else ""
    return f"{outcome.status}{against}{why}"


def changes_words(changes: Mapping[str, float], before: Mapping[str, float]) -> str:
    """What changed, parameter by parameter."""
    told = []
    for name, value in changes.items():
        unit = PARAMETERS[name].unit if name in PARAMETERS else ""
        old = f"{before[name]:.6g}" if before.get(name) is not None else "?"
        told.append(f"{name} {old} → {value:.6g} {unit}".rstrip())
    return ", ".join(told)


def _decision_lines(entry: DecisionEntry, outcome: OutcomeEntry | None) -> Iterator[str]:
    flights = max((one["flights"] for one in entry.sets), default=0)
    behind = f"{counted(flights, 'flight')} up to {entry.decided_after[:10] or 'an unknown day'}"
    note = " (exploratory)" if entry.exploratory else ""
    if not entry.changes:
        yield f"{entry.written[:10]}  kept what flies, from {behind}{note}"
        return
    yield f"{entry.written[:10]}  change to “{entry.chosen}”, from {behind}{note}"
    yield f"{_INDENT}{changes_words(entry.changes, entry.before)}"
    yield f"{_INDENT}predicted: errors {gain_words(entry.predicted)}"
    if not entry.is_loadable:
        yield f"{_INDENT}the vehicle could not be given it"
        return
    if outcome is not None:
        after = counted(outcome.paired.flights, "flight")
        yield f"{_INDENT}measured on {after} after it, old and new replayed on each: {gain_words(outcome.paired)}"
        yield f"{_INDENT}on board, from the flights before to those after: {gain_words(outcome.unpaired)}"
        yield f"{_INDENT}flights after it: {named(outcome.names)}"
    yield f"{_INDENT}{outcome_words(outcome)}"
