"""Settings that are given beside files: keys that name a place in a section, and values that a command line made texts.

Snakemake's ``--config`` takes plain keys alone, ``decision='{minimum_flights: 3}'``, and hands on all that stands
within as texts. `nested` and `in_their_types` make of that, and of ``decision.minimum_flights``, what a file would
hold; `plain_entries` writes entries with such keys as Snakemake takes them.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from fusetune.errors import UserError
from fusetune.settings.yaml_reader import value_of_text

SEPARATOR = "."
_REMEDY = "Write KEY=VALUE or SECTION.KEY=VALUE; config/README.md has the keys"


def nested(given: Mapping[str, Any], schema: Mapping[str, Any], given_by: str) -> dict[str, Any]:
    """Values by section, of keys that name the place of each in it.

    Names in a section that is a mapping of names, as ``decision.withheld_sources``, may have dots of their own.

    Raises
    ------
    UserError
        A key names a place in something that is no section.
    """
    values: dict[str, Any] = {}
    for key, value in given.items():
        section, inner = values, schema
        names = _names(str(key), schema)
        for name in names[:-1]:
            inner = _below(inner, name)
            section = section.setdefault(name, {})
            if not isinstance(section, dict):
                raise UserError(given_by, f"{key}: {name} is no section", _REMEDY)
        inner = _below(inner, names[-1])
        _put(section, names[-1], nested(value, inner, given_by) if isinstance(value, Mapping) else value)
    return values


def _names(key: str, schema: Mapping[str, Any]) -> list[str]:
    names: list[str] = []
    rest = key
    while "properties" in schema and SEPARATOR in rest:
        name, _, rest = rest.partition(SEPARATOR)
        names.append(name)
        schema = _below(schema, name)
    return [*names, rest]


def _below(schema: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = schema.get("properties", {}).get(name, schema.get("additionalProperties", {}))
    return found if isinstance(found, Mapping) else {}


def _put(section: dict[str, Any], name: str, value: Any) -> None:
    known = section.get(name)
    if isinstance(known, dict) and isinstance(value, dict):
        for key, part in value.items():
            _put(known, key, part)
    else:
        section[name] = value


def in_their_types(value: Any, schema: Mapping[str, Any]) -> Any:
    """Texts read as YAML reads them, wherever the schema wants something else; what is no text stays as it is."""
    if isinstance(value, Mapping):
        return {key: in_their_types(part, _below(schema, str(key))) for key, part in value.items()}
    if isinstance(value, list):
        return [in_their_types(part, schema.get("items", {})) for part in value]
    if not isinstance(value, str) or _may_be_text(value, schema):
        return value
    return value_of_text(value)


def _may_be_text(value: str, schema: Mapping[str, Any]) -> bool:
    if "enum" in schema:
        return value in schema["enum"]
    kinds = schema.get("type", [])
    return "string" in ([kinds] if isinstance(kinds, str) else kinds)


def plain_entries(entries: Iterable[str], given_by: str = "--config") -> list[str]:
    """Entries ``SECTION.KEY=VALUE`` as ``SECTION={"KEY": "VALUE"}``, as Snakemake's ``--config`` takes them.

    Raises
    ------
    UserError
        An entry has no key or no ``=``.
    """
    plain = []
    for entry in entries:
        key, sign, value = entry.partition("=")
        section, dot, name = key.partition(SEPARATOR)
        if not sign or not section or (dot and not name):
            raise UserError(given_by, f"{entry!r} is not KEY=VALUE", _REMEDY)
        plain.append(f"{section}={json.dumps({name: _read(value)})}" if dot else entry)
    return plain


def _read(text: str) -> Any:
    """A value that stands for more than a text is read here, for within another text nothing would read it."""
    value = value_of_text(text)
    return value if isinstance(value, dict | list) else text
