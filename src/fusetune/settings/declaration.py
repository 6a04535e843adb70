"""Settings as fields of dataclasses: each field declares its default, its meaning, its unit and the values it takes.

A setting stands nowhere else. The JSON schema by which files are checked follows from it (`fusetune.settings.schema`),
as do the shipped configuration and its manual. A field that declares nothing is no setting.

Imports nothing but the standard library, for every job loads it: a job gets values that the workflow has checked, so
that neither jsonschema nor pydantic is needed there, either of which costs a process a tenth of a second.
"""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cache
from types import NoneType
from typing import Any, Literal, TypeVar, cast, get_args, get_origin, get_type_hints

Settings = TypeVar("Settings")

_KEY = "declaration"


@dataclass(frozen=True)
class Declaration:
    """What is said of a setting beside its name, type and default.

    Of a list or mapping, `low`, `above`, `high` and `choices` hold for each of its values; the choices of a mapping are
    its keys.
    """

    meaning: str = ""
    """As a part of a sentence; of a group of settings without one, the first sentence of its class counts."""
    unit: str = ""
    low: float | None = None
    """Least value."""
    above: float | None = None
    """Values are greater than this."""
    high: float | None = None
    """Largest value."""
    choices: tuple[str, ...] = ()
    pattern: str = ""
    """Regular expression for the whole of a text, or for the keys of a mapping."""
    at_least: int = 0
    """Characters of a text, entries of a list or mapping and of lists in it."""
    filled_in: bool = False
    """A file may leave it out although it has no default: who reads the file knows it."""


@dataclass(frozen=True)
class DeclaredSetting:
    """A field of a dataclass that is a setting."""

    name: str
    kind: Any
    """Its type, resolved."""
    declaration: Declaration
    default: Any
    """`dataclasses.MISSING` where there is none."""

    @property
    def meaning(self) -> str:
        """What it means; a group says so by its class."""
        return self.declaration.meaning or (
            meaning_of(self.kind) if isinstance(self.kind, type) and is_dataclass(self.kind) else ""
        )


def setting(default: Any, meaning: str, **values: Any) -> Any:
    """Declare a setting with a default; `values` are fields of `Declaration`."""
    metadata = {_KEY: Declaration(meaning, **values)}
    if isinstance(default, dict):
        return field(default_factory=lambda: dict(default), metadata=metadata)
    return field(default=default, metadata=metadata)


def required(meaning: str = "", **values: Any) -> Any:
    """Declare a setting, or a group of them, that every file has to give."""
    return field(metadata={_KEY: Declaration(meaning, **values)})


def section(kind: type, meaning: str = "") -> Any:
    """Declare a group of settings of which each has a default."""
    return field(default_factory=kind, metadata={_KEY: Declaration(meaning)})


def meaning_of(kind: type) -> str:
    """First paragraph of a class's docstring in one line, without its full stop."""
    paragraph = (kind.__doc__ or "").partition("\n\n")[0]
    return " ".join(paragraph.split()).removesuffix(".")


@cache
def _types_of(kind: Any) -> Mapping[str, Any]:
    """Field → its type, whose words Python evaluates anew each time it is asked."""
    return get_type_hints(kind)


def declared(kind: type) -> Iterator[DeclaredSetting]:
    """The settings of a dataclass, in their order."""
    types = _types_of(kind)
    for each in fields(kind):
        if _KEY in each.metadata:
            default = each.default if each.default_factory is MISSING else each.default_factory()
            yield DeclaredSetting(each.name, types[each.name], each.metadata[_KEY], default)


def without_none(kind: Any) -> Any:
    """The type of a setting that may also be left empty, `X` of `X | None`; others as they are."""
    arguments = get_args(kind)
    return next(one for one in arguments if one is not NoneType) if NoneType in arguments else kind


def built(kind: type[Settings], values: Mapping[str, Any]) -> Settings:
    """A dataclass of settings from values that are known to be good; those left out have their defaults.

    Lists become tuples, whole numbers floats where the field is one, texts days, and mappings dataclasses.
    """
    types = _types_of(cast(Any, kind))  # a type is hashable, which mypy does not know of one that varies
    return kind(**{name: _converted(types[name], value) for name, value in values.items()})


def _converted(kind: Any, value: Any) -> Any:
    kind = without_none(kind)
    origin, arguments = get_origin(kind), get_args(kind)
    if value is None or origin is Literal or (isinstance(kind, type) and is_dataclass(value)):
        return value
    if is_dataclass(kind):
        return built(kind, value)  # type: ignore[arg-type]
    if kind is float:
        return float(value)
    if kind is datetime.date:
        return datetime.date.fromisoformat(value)
    if origin is tuple:
        return tuple(_converted(arguments[0], one) for one in value)
    if origin in (Mapping, dict) and Any not in arguments:
        return {key: _converted(arguments[1], one) for key, one in value.items()}
    return value
