"""The JSON schema that follows from declared settings."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import MISSING, asdict, is_dataclass, replace
from types import NoneType
from typing import Any, Literal, get_args, get_origin

from fusetune.settings.declaration import Declaration, DeclaredSetting, declared, meaning_of, without_none

DIALECT = "https://json-schema.org/draft/2020-12/schema"

_TYPES = {float: "number", int: "integer", bool: "boolean", str: "string"}
_BOUNDS = {"low": "minimum", "above": "exclusiveMinimum", "high": "maximum"}


def schema_of(kind: type) -> dict[str, Any]:
    """JSON schema (draft 2020-12) of a dataclass of settings; keys that are no setting are refused."""
    settings = list(declared(kind))
    needed = [one.name for one in settings if one.default is MISSING and not one.declaration.filled_in]
    return {
        "type": "object",
        "description": meaning_of(kind),
        "additionalProperties": False,
        **({"required": needed} if needed else {}),
        "properties": {one.name: _of_setting(one) for one in settings},
    }


def _of_setting(one: DeclaredSetting) -> dict[str, Any]:
    schema = _of_type(one.kind, one.declaration)
    if is_dataclass(one.kind):
        default: dict[str, Any] = {}
    else:
        default = {} if one.default is MISSING else {"default": _as_json(one.default)}
    unit = f" [{one.declaration.unit}]" if one.declaration.unit else ""
    return schema | default | {"description": f"{one.meaning}{unit}"}


def _of_type(kind: Any, declaration: Declaration) -> dict[str, Any]:
    arguments, origin = get_args(kind), get_origin(kind)
    if NoneType in arguments:
        schema = _of_type(without_none(kind), declaration)
        if "enum" in schema:
            return {"enum": [*schema["enum"], None]}
        return schema | {"type": [schema["type"], "null"]}
    if is_dataclass(kind):
        return schema_of(kind)  # type: ignore[arg-type]
    if origin is Literal:
        return {"enum": list(arguments)}
    if origin is tuple:
        return _of_tuple(arguments, declaration)
    if origin in (Mapping, dict):
        return _of_mapping(arguments[1], declaration)
    if kind is datetime.date:
        return {"type": "string", "pattern": declaration.pattern}
    if kind is str:
        return _of_text(declaration)
    return {"type": _TYPES[kind], **_bounds(declaration)} if kind in _TYPES else {}


def _of_text(declaration: Declaration) -> dict[str, Any]:
    if declaration.choices:
        return {"enum": list(declaration.choices)}
    pattern = {"pattern": declaration.pattern} if declaration.pattern else {}
    return {"type": "string", **_least("minLength", declaration), **pattern}


def _of_tuple(arguments: tuple[Any, ...], declaration: Declaration) -> dict[str, Any]:
    items = {"type": "array", "items": _of_type(arguments[0], declaration)}
    if arguments[-1] is not Ellipsis:
        return items | {"minItems": len(arguments), "maxItems": len(arguments)}
    return items | _least("minItems", declaration)


def _of_mapping(values: Any, declaration: Declaration) -> dict[str, Any]:
    names: dict[str, Any] = {"enum": list(declaration.choices)} if declaration.choices else {}
    if declaration.pattern:
        names = {"type": "string", "pattern": declaration.pattern}
    of_each = replace(declaration, choices=(), pattern="")
    return {
        "type": "object",
        **_least("minProperties", declaration),
        **({"propertyNames": names} if names else {}),
        **({"additionalProperties": _of_type(values, of_each)} if values is not Any else {}),
    }


def _least(keyword: str, declaration: Declaration) -> dict[str, int]:
    return {keyword: declaration.at_least} if declaration.at_least else {}


def _bounds(declaration: Declaration) -> dict[str, float]:
    limits = asdict(declaration)
    return {keyword: limits[name] for name, keyword in _BOUNDS.items() if limits[name] is not None}


def _as_json(default: Any) -> Any:
    return list(default) if isinstance(default, tuple) else default
