"""The part of the page about the decisions before: what was changed when, and what it brought."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fusetune.apply.history.entries import Gain, OutcomeEntry
from fusetune.apply.history.words import changes_words, gain_in_short, outcome_words
from fusetune.report.markup import Cell, paragraph, section, table

_KINDS = {"confirmed": "good", "refuted": "bad"}


def history_section(history: Mapping[str, Any] | None) -> str:
    """A row for each change of the vehicle, the newest first; empty where nothing was ever changed.

    Parameters
    ----------
    history : what `results/apply/history.json` holds; None where no history is kept
    """
    decisions = history["decisions"] if history is not None else []
    changes = [one for one in decisions if one["changes"]]
    if not changes:
        return ""
    kept = len(decisions) - len(changes)
    head = ("decided after", "change", "predicted", "paired", "on board", "")
    return section(
        "What was changed when, and what it brought",
        table(head, [_row(one) for one in reversed(changes)]),
        paragraph(
            f"Decisions kept: {len(decisions)}, of which {kept} left what flies. Figures: by how much prediction "
            "errors became smaller, with the interval. Paired: on the flights after a change the old and the new "
            "values are replayed on each, so wind and route are the same for both; by this a change is confirmed (its "
            "interval above 0) or refuted (its interval below the smallest gain that counts, or the new values ruled "
            "out). On board: the flights before against those after, each with what it flew; other days and routes are "
            "in it. No flight after a change had a part in deciding it.",
            "note",
        ),
    )


def _row(one: Mapping[str, Any]) -> tuple[Cell, ...]:
    outcome = None
    if one["outcome"] is not None:
        gains = {name: Gain(**one["outcome"][name]) for name in ("paired", "unpaired")}
        outcome = OutcomeEntry(**{"of": "", "written": "", **one["outcome"], **gains})
    word = "could not be loaded" if not one["is_loadable"] else outcome_words(outcome)
    return (
        Cell(one["decided_after"][:10] or "–"),
        Cell(changes_words(one["changes"], one["previous"]).replace("^2", "²")),
        Cell(gain_in_short(Gain(**one["predicted"]))),
        Cell(gain_in_short(outcome.paired) if outcome is not None else "–"),
        Cell(gain_in_short(outcome.unpaired) if outcome is not None else "–"),
        Cell(word, _KINDS.get(outcome.status, "") if outcome is not None else "quiet"),
    )
