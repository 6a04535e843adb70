"""The answer of a search in a few lines: what to set, what it is worth, what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fusetune.apply.search.words import worth_sentences
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.set_names import FOUND, PRESENT

_MOST_PARAMETERS = 5


def headline(document: Mapping[str, Any], decision: Mapping[str, Any]) -> str:
    """What to do, without a full stop.

    Parameters
    ----------
    document : what `search.json` holds
    decision : what `decision.json` beside it holds
    """
    flights = len(document["flights"])
    on = f"from {flights} flight{'s' if flights != 1 else ''}"
    if decision["status"] != "change":
        return f"Keep the parameters that fly now, {on}"
    count = len(decision["changes"])
    return f"Change {count} parameter{'s' if count != 1 else ''}, {on}"


def answer_lines(document: Mapping[str, Any], decision: Mapping[str, Any], what_matters: Sequence[str]) -> list[str]:
    """The answer first, then what it rests on, at most ten lines.

    Parameters
    ----------
    what_matters : what the sets that were tried tell of the parameters, the answer first
    """
    return list(_lines(document, decision, what_matters))


def _lines(document: Mapping[str, Any], decision: Mapping[str, Any], what_matters: Sequence[str]) -> Iterator[str]:
    yield f"{headline(document, decision)}{' (exploratory)' if document['exploratory'] else ''}."
    if decision["status"] == "change":
        yield from _changes(document, decision)
    yield from worth_sentences(document)
    yield from why_kept(document, decision)
    yield from what_matters[:1]
    if decision["next_steps"]:
        yield f"Next: {decision['next_steps'][0]['text']}"


def _changes(document: Mapping[str, Any], decision: Mapping[str, Any]) -> Iterator[str]:
    """A line for each parameter, in columns."""
    changes = decision["changes"]
    rows = [
        (
            one["name"],
            _from_to(one["previous"], one["value"], one["unit"]),
            _about(document["parameters"].get(one["name"]) if takes_found(decision) else None),
        )
        for one in changes[:_MOST_PARAMETERS]
    ]
    widths = [max(len(row[column]) for row in rows) for column in (0, 1)]
    for name, values, about in rows:
        yield f"  {name:<{widths[0]}}  {values:<{widths[1]}}  {about}".rstrip()
    if len(changes) > _MOST_PARAMETERS:
        yield f"  and {len(changes) - _MOST_PARAMETERS} more"


def _about(one: Mapping[str, Any] | None) -> str:
    """What a parameter brings alone; of what goes along with another nothing is known."""
    if one is None or one["alone_percent"] is None:
        return ""
    bound = f"; not determined: the {one['at_bound']} value that was tried" if one["at_bound"] else ""
    return f"without it errors {one['alone_percent']:.1f} % larger{bound}"


def takes_found(decision: Mapping[str, Any]) -> bool:
    """Whether the decision changes to what the search found, and not to a set beside it, or to nothing."""
    return bool(decision["status"] == "change" and decision["chosen"] == FOUND)


def why_kept(document: Mapping[str, Any], decision: Mapping[str, Any]) -> list[str]:
    """Why what was found is not taken; empty where it is, and where nothing was found."""
    found = {name: one for name, one in document["parameters"].items() if one["is_changed"]}
    if not found or takes_found(decision):
        return []
    values = [f"{name} {_from_to(one['present'], one['found'], unit_of(name))}" for name, one in found.items()]
    more = f" and {len(values) - _MOST_PARAMETERS} more" if len(values) > _MOST_PARAMETERS else ""
    told = [f"Found, and not taken: {', '.join(values[:_MOST_PARAMETERS])}{more}."]
    reasons = [*document["objections"], *_reasons(decision)]
    if reasons:
        told.append(f"Against it: {'; '.join(reasons[:2])}.")
    elif decision["chosen"] != PRESENT:
        told.append(f"Against it: {decision['chosen']}, a single effect as the flights measure it, is to be preferred.")
    elif document["exploratory"]:
        told.append("Against it: so few flights show nothing firm.")
    elif decision["status"] == "keep":
        told.append("Against it: these flights do not show beyond doubt that it would help on others.")
    return told


def _from_to(now: float, found: float, unit: str) -> str:
    return f"{now:.4g} → {found:.4g} {unit}".rstrip()


def _reasons(decision: Mapping[str, Any]) -> list[str]:
    return [str(reason) for one in decision["ranking"] if one["name"] == FOUND for reason in one["reasons"]]


def unit_of(parameter: str) -> str:
    """As the metadata spells it."""
    return PARAMETERS[parameter].unit if parameter in PARAMETERS else ""
