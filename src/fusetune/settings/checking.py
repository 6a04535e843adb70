"""Checking a configuration file so that every mistake is told with its file, key and what was expected.

Imports nothing heavier than PyYAML and jsonschema: the workflow reads configuration files whenever it starts.
"""

from __future__ import annotations

import difflib
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from itertools import islice
from typing import Any

import jsonschema

from fusetune.errors import UserError
from fusetune.settings.declaration import Settings, built
from fusetune.settings.schema import schema_of
from fusetune.settings.yaml_reader import describe, read_yaml

MOST_PROBLEMS_SHOWN = 8
MOST_PROBLEMS_SOUGHT = 100
LONGEST_PROBLEM = 400
REMEDY = "Mend the named keys; config/README.md and the examples beside it show what may stand there"

_JSON_TYPE_NAMES = {
    "object": "a mapping (keys and values)",
    "array": "a list",
    "string": "a text",
    "number": "a number",
    "integer": "a whole number",
    "boolean": "true or false",
    "null": "nothing",
}


LARGEST_INTEGER = 2**53
"""Up to here a float holds every whole number."""


def _matches_whole(
    validator: Any, pattern: str, instance: object, schema: Mapping[str, Any]
) -> Iterator[jsonschema.ValidationError]:
    """A pattern whose ``$`` is the end of the text, as in JSON Schema; Python's stands before a last line feed, too."""
    if isinstance(instance, str) and not re.fullmatch(pattern, instance):
        yield jsonschema.ValidationError(f"{instance!r} does not match {pattern!r}")


_Validator = jsonschema.validators.extend(
    jsonschema.Draft202012Validator,
    validators={"pattern": _matches_whole},
    # 8.0 is whole to JSON Schema, and no use where Python counts
    type_checker=jsonschema.Draft202012Validator.TYPE_CHECKER.redefine(
        "integer", lambda checker, value: isinstance(value, int) and not isinstance(value, bool)
    ),
)


def checked(kind: type[Settings], document: Mapping[str, Any], path: str | os.PathLike[str]) -> Settings:
    """Check a document against the settings that a dataclass declares, and build it.

    What no single setting can tell is asked of the method `problems` of the dataclass and of those within it, where
    they have one: sentences that begin with the key at fault.

    Raises
    ------
    UserError
        As `validate`.
    """
    validate(document, schema_of(kind), path)
    settings = built(kind, document)
    raise_problems(path, _contradictions(settings, ""), REMEDY)
    return settings


def _contradictions(settings: Any, place: str) -> Iterator[str]:
    if hasattr(settings, "problems"):
        yield from (f"{place}{problem}" for problem in settings.problems())
    for each in fields(settings):
        part = getattr(settings, each.name)
        if is_dataclass(part):
            yield from _contradictions(part, f"{place}{each.name}.")


def read_checked(path: str | os.PathLike[str], schema: Mapping[str, Any]) -> dict[str, Any]:
    """Read a YAML file and check it against a JSON schema.

    Raises
    ------
    UserError
        The file cannot be read, or as `validate`.
    """
    document = read_yaml(path)
    validate(document, schema, path)
    return document


def validate(document: Mapping[str, Any], schema: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Check a document against a JSON schema.

    Raises
    ------
    UserError
        Names every key at fault with what was found and what was expected.
    """
    raise_problems(path, islice(_number_problems(document, ()), MOST_PROBLEMS_SOUGHT), REMEDY)
    found = islice(_Validator(schema).iter_errors(document), MOST_PROBLEMS_SOUGHT)
    errors = sorted(found, key=lambda error: [str(part) for part in error.absolute_path])
    raise_problems(path, (problem for error in errors for problem in _problems(error)), REMEDY)


def raise_problems(path: str | os.PathLike[str], problems: Iterable[str], remedy: str) -> None:
    """Raise one `UserError` that tells all problems found in a file; do nothing where there is none."""
    found = list(dict.fromkeys(_shortened(problem) for problem in problems))
    if not found:
        return
    shown = found[:MOST_PROBLEMS_SHOWN]
    if len(found) > len(shown):
        shown.append(f"and {len(found) - len(shown)} more")
    raise UserError(path, "; ".join(shown), remedy)


def _shortened(problem: str) -> str:
    line = " ".join(problem.split())
    return line if len(line) <= LONGEST_PROBLEM else f"{line[:LONGEST_PROBLEM]}…"


def _number_problems(value: object, place: tuple[str | int, ...]) -> Iterator[str]:
    """Numbers that no setting can mean, wherever they stand."""
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from _number_problems(part, (*place, str(key)))
    elif isinstance(value, list):
        for index, part in enumerate(value):
            yield from _number_problems(part, (*place, index))
    elif isinstance(value, float) and not math.isfinite(value):
        yield f"{key_path(place)} is {value}; expected a finite number"
    elif isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        yield f"{key_path(place)} is a number of {len(str(abs(value)))} digits; expected at most {LARGEST_INTEGER}"


def nearest(name: str, candidates: Iterable[str]) -> str:
    """A hint ``" (did you mean 'X'?)"`` for a name that is not among the candidates; empty where none is near."""
    matches = difflib.get_close_matches(name[:100], list(candidates), n=1, cutoff=0.6)
    return f" (did you mean {matches[0]!r}?)" if matches else ""


def key_path(parts: Iterable[str | int]) -> str:
    """Place of a value in a document as a reader writes it: ``waypoints[2].lat``."""
    text = ""
    for part in parts:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def _problems(error: jsonschema.ValidationError) -> list[str]:
    """What one schema violation means, in words."""
    place = key_path(error.absolute_path)
    prefix = f"{place}: " if place else ""
    schema: dict[str, Any] = dict(error.schema) if isinstance(error.schema, Mapping) else {}
    if error.validator == "additionalProperties":
        properties = schema.get("properties", {})
        # what may not stand here, as a key of former releases, is no choice
        known = [name for name in properties if "not" not in properties[name]]
        unknown = [str(key) for key in _keys(error.instance) if key not in properties]
        return [
            f"{prefix}unknown key {describe(key)}{nearest(key, known)}; expected one of {', '.join(known)}"
            for key in unknown[:MOST_PROBLEMS_SHOWN]
        ]
    if error.validator == "required":
        missing = [key for key in _keys(error.validator_value) if key not in _keys(error.instance)]
        return [f"{prefix}the key {key!r} is missing; expected {_expected_of(schema, key)}" for key in missing]
    if error.validator == "not":
        return [f"{prefix}{schema.get('description', 'is not allowed here')}"]
    if "propertyNames" in list(error.absolute_schema_path)[-2:]:
        return [f"{prefix}the key {describe(error.instance)} is not a valid name; expected {_expected(schema)}"]
    return [f"{place or 'top level'} is {describe(error.instance)}; expected {_expected(schema)}"]


def _keys(value: object) -> list[str]:
    return list(value) if isinstance(value, Mapping | list) else []


def _expected_of(schema: Mapping[str, Any], key: str) -> str:
    return _expected(schema.get("properties", {}).get(key, {}))


def _expected(schema: Mapping[str, Any]) -> str:
    """A schema of one value, in words."""
    if "const" in schema:
        return repr(schema["const"])
    if "enum" in schema:
        return "one of " + ", ".join(repr(value) for value in schema["enum"])
    kind = schema.get("type", "a value")
    kinds = kind if isinstance(kind, list) else [kind]
    text = " or ".join(_JSON_TYPE_NAMES.get(str(name), str(name)) for name in kinds) + _bounds(schema)
    if schema.get("description"):
        text += f" – {str(schema['description']).strip().rstrip('.')}"
    return text


def _bounds(schema: Mapping[str, Any]) -> str:
    if "minimum" in schema and "maximum" in schema:
        return f" between {schema['minimum']} and {schema['maximum']}"
    if "minItems" in schema and schema["minItems"] == schema.get("maxItems"):
        return f" of length {schema['minItems']}"
    parts = [
        f" {words} {schema[keyword]}"
        for keyword, words in (
            ("minimum", "of at least"),
            ("exclusiveMinimum", "greater than"),
            ("maximum", "of at most"),
            ("exclusiveMaximum", "less than"),
            ("minItems", "of length at least"),
            ("maxItems", "of length at most"),
            ("minProperties", "of size at least"),
        )
        if keyword in schema
    ]
    if "pattern" in schema:
        parts.append(f" of the form {schema['pattern']}")
    return ",".join(parts)
