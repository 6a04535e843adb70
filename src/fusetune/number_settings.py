"""A section of the configuration that is nothing but numbers, as the fields of a dataclass."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from fusetune.errors import UserError


def checked_numbers(section: str, noun: str, kind: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Values for the fields of a dataclass, each of the type of the field's default.

    Parameters
    ----------
    noun
        What one of them is called.

    Raises
    ------
    UserError
        A key is no field, or its value no finite number from 0 on.
    """
    known = {field.name: type(getattr(kind, field.name)) for field in fields(kind)}
    for name, value in values.items():
        if name not in known:
            raise UserError(section, f"{name} is no {noun}", f"Use one of {', '.join(known)}")
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < math.inf:
            raise UserError(section, f"{name} is {value!r}, expected a number from 0 on", "Mend the value")
    return {name: known[name](value) for name, value in values.items()}
