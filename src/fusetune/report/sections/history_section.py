"""The part of the page about the decisions before: what was changed when, and what it brought."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fusetune.apply.history.entries import Gain, OutcomeEntry
from fusetune.apply.history.words import changes_words, outcome_words
from fusetune.report.markup import Cell, paragraph, section, signed, table

_KINDS = {"confirmed": "good", "refuted": "bad"}


def history_section(history: Mapping[str, Any] | None) -> str:
    """A row for each change of the vehicle, the newest first; empty where nothing but now was changed.

    Parameters
    ----------
    history : what `results/apply/history.json` holds; None where no history is kept
    """
    decisions = history["decisions"] if history is not None else []
    changes = [one for one in decisions if one["changes"]]
    if not changes or (len(changes) == 1 and changes[0]["outcome"] is None):
        return ""
    kept = len(decisions) - len(changes)
    head = ("decided after", "change", "predicted", "paired", "on board", "")
    return section(
        "What was changed before, and what it brought",
        table(head, [_row(one) for one in reversed(changes)]),
        paragraph(
            f"Decisions kept: {len(decisions)}, of which {kept} left what flies. Figures: change of the prediction "
            "errors, with the interval; below 0 is better. Paired: on the flights after a change the old and the new "
            "values are replayed on each, so wind and route are the same for both; by this a change is confirmed (its "
            "interval below 0) or refuted (its interval above the smallest gain that counts, or the new values ruled "
            "out). On board: the flights before against those after, each with what it flew; other days and routes are "
            "in it. No flight after a change had a part in deciding it.",
            "note",
        ),
        id="history",
    )


def _change(gain: Gain | None) -> Cell:
    """A gain as the change of the errors that it is."""
    if gain is None or gain.percent is None:
        return Cell("–", "number quiet")
    told = f"{_percent(gain.percent)} %"
    if gain.lower is None or gain.upper is None:
        return Cell(told, "number")
    return Cell(f"{told} ({_percent(gain.upper)} to {_percent(gain.lower)})", "number")


def _percent(gain: float) -> str:
    return signed(-gain if gain else 0.0).text


def _row(one: Mapping[str, Any]) -> tuple[Cell, ...]:
    outcome = None
    if one["outcome"] is not None:
        gains = {name: Gain(**one["outcome"][name]) for name in ("paired", "unpaired")}
        outcome = OutcomeEntry(**{"of": "", "written": "", **one["outcome"], **gains})
    word = "could not be loaded" if not one["is_loadable"] else outcome_words(outcome)
    return (
        Cell(one["decided_after"][:10] or "–"),
        Cell(changes_words(one["changes"], one["previous"]).replace("^2", "²")),
        _change(Gain(**one["predicted"])),
        _change(outcome.paired if outcome is not None else None),
        _change(outcome.unpaired if outcome is not None else None),
        Cell(word, _KINDS.get(outcome.status, "") if outcome is not None else "quiet"),
    )
