"""Which parameter sets the views of a flight show, and their part in the decision."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusetune.report.flight_data.content import Role, ShownSet
from fusetune.report.flight_data.shown_limit import MOST_SHOWN_SETS
from fusetune.report.set_styles import set_style, set_styles
from fusetune.set_names import AS_FLOWN, ONBOARD
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table

_DRAWN = ("scored", "excluded", "not_scored")
"""States of a set whose replay ran to the end."""


@dataclass(frozen=True)
class Choice:
    """What was decided; empty before.

    Attributes
    ----------
    chosen : the recommended set; None where the present one stays
    ruled_out : sets that cannot be chosen
    """

    chosen: str | None = None
    ruled_out: frozenset[str] = frozenset()

    def role_of(self, name: str, present: str) -> Role:
        """The part of a set."""
        if name in (ONBOARD, AS_FLOWN):
            return "onboard" if name == ONBOARD else "as_flown"
        if name == present:
            return "present"
        if name == self.chosen:
            return "chosen"
        return "ruled_out" if name in self.ruled_out else "candidate"


UNDECIDED = Choice()


def replayed_sets(
    scoring: Mapping[str, Any] | None, scores: AnyPath, first: Sequence[str] = (), most: int = MOST_SHOWN_SETS
) -> list[str]:
    """Names of the sets that are shown: the present one, then those that are to be first, then the others.

    Parameters
    ----------
    scoring : `scoring.json`; None of a flight that was not replayed
    scores : `scores.parquet`, which says which sets predict best where there are too many

    Raises
    ------
    UserError
        There are too many, and the scores are missing or damaged.
    """
    if scoring is None:
        return []
    told, present = scoring["sets"], scoring["present"]
    names = [name for name in dict.fromkeys([present, *first, *told]) if told.get(name, {}).get("status") in _DRAWN]
    if len(names) <= most + 1:
        return names
    errors = relative_errors(scores, present)
    # so many that are to be first say as little as none does; what is first of all is what was chosen, if anything was
    wanted = {present, *(first if len(first) <= most else first[:1])}
    best = sorted(names, key=lambda name: (name != present, name not in wanted, errors.get(name, math.inf)))
    kept = set(best[: most + 1])
    return [name for name in names if name in kept]


def relative_errors(scores: AnyPath, present: str) -> dict[str, float]:
    """How large the innovations of each set are: mean over sources of the logarithm of their RMS against the present's.

    Raises
    ------
    UserError
        The scores are missing or damaged.
    """
    table = read_table(scores, ["set", "source", "n", "sum_squared_innovation"])
    sets, sources = (table[name].combine_chunks().dictionary_encode() for name in ("set", "source"))
    names = sets.dictionary.to_pylist()
    if present not in names:
        return {}
    shape = len(names), len(sources.dictionary)
    place = sets.indices.to_numpy() * shape[1] + sources.indices.to_numpy()
    counted, squares = (
        np.bincount(place, table[name].to_numpy(), shape[0] * shape[1]).reshape(shape)
        for name in ("n", "sum_squared_innovation")
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = 0.5 * np.log(squares / counted)
    against = logs - logs[names.index(present)]
    known = np.isfinite(against)
    return {name: float(against[row, known[row]].mean()) for row, name in enumerate(names) if known[row].any()}


def shown_sets(
    names: Sequence[str], scoring: Mapping[str, Any] | None, present: str, choice: Choice = UNDECIDED
) -> tuple[ShownSet, ...]:
    """The sets as the views show them.

    Parameters
    ----------
    names : of those that have something to show, `onboard` and `as_flown` too
    scoring : `scoring.json`: with the sets of the study, by which they are told apart; None as of `replayed_sets`
    """
    styles = set_styles(() if scoring is None else scoring["sets"], present, choice.chosen)
    found = []
    for name in names:
        style = styles.get(name) or set_style(name, present, choice.chosen)
        found.append(ShownSet(name, choice.role_of(name, present), style.index, style.marker))
    return tuple(found)
