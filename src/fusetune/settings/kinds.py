"""Lists in a file whose entries are of several kinds, each a dataclass of settings of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from fusetune.settings.declaration import built
from fusetune.settings.schema import schema_of

Kind = TypeVar("Kind")


def schema_of_kinds(key: str, kinds: Mapping[str, type], meaning: str, kind_meaning: str) -> dict[str, Any]:
    """JSON schema of a document that holds such a list.

    Parameters
    ----------
    key : under which the list stands
    kinds : what `kind` of an entry may be → the dataclass of its other keys
    meaning, kind_meaning : of the list, and of `kind`
    """
    return {
        "type": "object",
        "required": [key],
        "properties": {
            key: {
                "type": "array",
                "description": meaning,
                "items": {
                    "type": "object",
                    "required": ["kind"],
                    "properties": {"kind": {"enum": list(kinds), "description": kind_meaning}},
                    "allOf": [_schema_of_kind(name, kind) for name, kind in kinds.items()],
                },
            }
        },
    }


def built_of_kind(kinds: Mapping[str, type[Kind]], entry: Mapping[str, Any]) -> Kind:
    """An entry that is known to be good."""
    return built(kinds[entry["kind"]], {key: value for key, value in entry.items() if key != "kind"})


def _schema_of_kind(name: str, kind: type) -> dict[str, Any]:
    """What holds of an entry of this kind."""
    schema = schema_of(kind)
    return {
        "if": {"properties": {"kind": {"const": name}}, "required": ["kind"]},
        "then": schema | {"properties": {"kind": {}} | schema["properties"]},
    }
