"""The parameters of a search as charts and figures show them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fusetune.apply.search.answer import unit_of

Parameters = Mapping[str, Mapping[str, Any]]
"""Of `search.json`."""


def axis_groups(parameters: Parameters) -> dict[str | None, list[str]]:
    """Parameters that share an axis: by unit, or all ratios; None stands for ratios. Those that change come first."""
    found: dict[str | None, list[str]] = {}
    for name, one in sorted(parameters.items(), key=lambda item: not item[1]["is_changed"]):
        found.setdefault(None if one["scale"] == "log" else unit_of(name), []).append(name)
    return found


def from_to_words(name: str, one: Mapping[str, Any]) -> str:
    """What flies now and what was found, with the unit."""
    now, found = (f"{one[part]:.3g}".replace("-", "−") for part in ("present", "found"))
    unit = unit_of(name).replace("^2", "²")
    return f"{now} → {found} {unit}".rstrip() if one["is_changed"] else f"{now} {unit}".rstrip()


def found_title(parameters: Parameters) -> str:
    """How many would change, and which are not determined."""
    changed = [name for name, one in parameters.items() if one["is_changed"]]
    bound = [name for name in changed if parameters[name]["at_bound"]]
    if not changed:
        return "The search found no parameter worth changing"
    count = f"{len(changed)} of {len(parameters)} parameters would change"
    return f"{count}; not determined: {', '.join(bound)}" if bound else count
