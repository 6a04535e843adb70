"""Settings of a decision, each under a name of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

DERIVED = ("main_source",)
"""What `rule` in decision.json holds beside settings: it follows from them."""


def flat_settings(rule: Mapping[str, Any]) -> dict[str, Any]:
    """Settings by name; those of a mapping with a dot between, as `sources.gnss_vel`; tuples as the lists of a file."""
    flat: dict[str, Any] = {}
    for name, value in rule.items():
        if name in DERIVED:
            continue
        if isinstance(value, Mapping):
            flat |= {f"{name}.{key}": one for key, one in value.items()}
        else:
            flat[name] = list(value) if isinstance(value, tuple) else value
    return flat


def changed_settings(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Settings that two rules have otherwise, with the value of each; None where a rule does not have it."""
    before, after = flat_settings(one), flat_settings(other)
    return {
        name: (before.get(name), after.get(name))
        for name in dict.fromkeys((*before, *after))
        if before.get(name) != after.get(name)
    }
