"""What a pilot is told of a search."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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
    if not any(one["is_changed"] for one in document["parameters"].values()):
        return ["The search found nothing that is better than the present parameters by as much as would matter."]
    sentences = [*_gains(document)]
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


def _gains(document: Mapping[str, Any]) -> Iterator[str]:
    search, aside = document["gain_in_search_percent"], document["gain_kept_aside_percent"]
    if search is None or aside is None:
        return
    yield (
        f"On the flights that the search saw, errors are {_smaller(search)} with what it found; on flights that were "
        f"kept aside from it, {_smaller(aside)}. The second is what to expect."
    )
    expected = document["expected_gain"]
    if expected is not None and expected["lower_percent"] is not None:
        yield (
            f"On as many flights again, between {expected['lower_percent']:.1f} and {expected['upper_percent']:.1f} % "
            "smaller (95 %; a minus means larger)."
        )


def _smaller(percent: float) -> str:
    return f"{percent:.1f} % smaller" if percent >= 0.0 else f"{-percent:.1f} % larger"
