"""What a pilot is told of a search."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fusetune.apply.search.result import alone_percent
from fusetune.apply.search.stages import Found
from fusetune.design.tunable_parameters import DELAY_LIMIT


def alone_sentences(found: Found) -> dict[str, str]:
    """What each parameter that is changed brings alone; for the parameter file."""
    told = {}
    for name in found.changed:
        percent = alone_percent(found, name)
        assert percent is not None, "every parameter that is changed was put back once"
        told[name] = f"without this one errors would be {percent:.1f} % larger on the flights of the search"
    return told | {DELAY_LIMIT: "goes along with the longer delay: PX4 keeps samples no longer than this"}


def search_sentences(document: Mapping[str, Any]) -> list[str]:
    """The search in words: what it is worth, and what it could not tell."""
    sentences = worth_sentences(document)
    changed = {name: one for name, one in document["parameters"].items() if one["is_changed"]}
    bounds = [
        f"{name} ({one['at_bound']} value that is tried, {one['found']:g})"
        for name, one in changed.items()
        if one["at_bound"]
    ]
    if bounds:
        sentences.append(
            f"Not determined: {', '.join(bounds)}. The flights ask for a value beyond; how far, they do not say."
        )
    back = [
        name
        for name, one in document["parameters"].items()
        if not one["is_changed"] and one["before_putting_back"] != one["present"]
    ]
    if back:
        sentences.append(f"Put back to the present value, as it costs next to nothing: {', '.join(back)}.")
    return sentences


def worth_sentences(document: Mapping[str, Any]) -> list[str]:
    """What was found is worth on flights that were kept aside, and on those that the search saw.

    Parameters
    ----------
    document : what `search.json` holds
    """
    seen, aside = document["gain_in_search_percent"], document["gain_kept_aside_percent"]
    if not any(one["is_changed"] for one in document["parameters"].values()):
        return ["The search found nothing that is better than what flies now by as much as would matter."]
    if seen is None:
        return ["These flights cannot show what the search's find is worth."]
    if aside is None:
        return [
            f"With what the search found, prediction errors are {_smaller(seen)} on the flight that it saw. None was "
            "kept aside, so nothing shows how much of that is luck."
        ]
    return [
        f"With what the search found, prediction errors are {_smaller(aside)} on flights that were kept aside from it, "
        f"and {_smaller(seen)} on those that it saw.{_expected(document['expected_gain'])}"
    ]


def _expected(gain: Mapping[str, float | None] | None) -> str:
    """The interval in words, behind a space; empty where there is none."""
    lower, upper = (None, None) if gain is None else (gain["lower_percent"], gain["upper_percent"])
    if lower is None or upper is None:
        return ""
    ends = f"{lower:.1f} to {upper:.1f} % smaller" if lower >= 0.0 else f"from {_smaller(lower)} to {_smaller(upper)}"
    return f" On as many flights again expect them {ends} (95 %)."


def _smaller(percent: float) -> str:
    """By how much errors are smaller, or larger."""
    return f"{percent:.1f} % smaller" if percent >= 0.0 else f"{-percent:.1f} % larger"
