"""Which parameter sets the views of a flight show, and their part in the decision."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fusetune.report.flight_data.content import Role, ShownSet
from fusetune.report.set_styles import set_style, set_styles
from fusetune.set_names import AS_FLOWN, ONBOARD

MOST_SETS = 12
"""Beside the present one: more curves than that nobody tells apart."""
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


def replayed_sets(
    scoring: Mapping[str, Any] | None, asked: Sequence[str] = (), choice: Choice | None = None
) -> list[str]:
    """Names of the sets that are shown: the present one, the chosen one, then in the order asked for, or of the file.

    Parameters
    ----------
    scoring : `scoring.json`; None of a flight that was not replayed
    """
    if scoring is None:
        return []
    told, present = scoring["sets"], scoring["present"]
    wanted = [present, *([choice.chosen] if choice and choice.chosen else ()), *asked, *(() if asked else told)]
    names = [name for name in dict.fromkeys(wanted) if told.get(name, {}).get("status") in _DRAWN]
    return names[: MOST_SETS + 1]


def shown_sets(
    names: Sequence[str], scoring: Mapping[str, Any] | None, present: str, choice: Choice
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
        style = styles.get(name) or set_style(name, present)
        found.append(ShownSet(name, choice.role_of(name, present), style.index, style.marker))
    return tuple(found)
