"""Study files that name parameters as newer releases of PX4 do, in the names in which sets are compared."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from fusetune.px4.parameters.set_names import NEWER_NAMES, in_baseline_names

_NAMED = ("fixed", "vary", "factors", "bounds")
_WORD = re.compile(r"[A-Z0-9_]+")


def in_known_names(document: Mapping[str, Any]) -> dict[str, Any]:
    """A study file with the baseline's names in place of those that newer releases have for the same parameter.

    Raises
    ------
    ParameterError
        A parameter is given under both names.
    """
    found: dict[str, Any] = {
        key: in_baseline_names(value) if key in _NAMED else value for key, value in document.items()
    }
    if "parameters" in found:
        found["parameters"] = [_renamed(name) for name in found["parameters"]]
    if "sets" in found:
        found["sets"] = [dict(one) | {"parameters": in_baseline_names(one["parameters"])} for one in found["sets"]]
    if "constraints" in found:
        found["constraints"] = [_WORD.sub(lambda one: _renamed(one[0]), text) for text in found["constraints"]]
    if "search" in found:
        found["search"] = in_known_names(found["search"])
    return found


def _renamed(name: str) -> str:
    return NEWER_NAMES.get(name, name)
