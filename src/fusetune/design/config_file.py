"""Reading a YAML configuration file so that every mistake is told with its file, key and what was expected.

Imports nothing heavier than PyYAML and jsonschema: the workflow reads configuration files whenever it starts.
"""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import resources
from typing import Any

import jsonschema
import yaml

from fusetune.errors import UserError

MOST_PROBLEMS_SHOWN = 8

_JSON_TYPE_NAMES = {
    "object": "a mapping (keys and values)",
    "array": "a list",
    "string": "a text",
    "number": "a number",
    "integer": "a whole number",
    "boolean": "true or false",
    "null": "nothing",
}


class _Loader(yaml.SafeLoader):
    """Safe YAML that refuses a key written twice, reads ``1e-3`` as the number it is and leaves dates as texts."""

    yaml_implicit_resolvers = {  # noqa: RUF012 - PyYAML's own way of telling a loader what plain texts mean
        first: [(tag, pattern) for tag, pattern in resolvers if not tag.endswith(":timestamp")]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        first_line: dict[str, int] = {}
        for key_node, _ in node.value:
            key = str(key_node.value)
            line = key_node.start_mark.line + 1
            if key in first_line:
                raise _DuplicateKey(key, first_line[key], line)
            first_line[key] = line
        return super().construct_mapping(node, deep)


# YAML 1.1 asks for a dot in a float, so PyYAML takes 1e-3 for a text.
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(?:\d+(?:\.\d*)?|\.\d+)[eE][-+]?\d+$"),
    list("-+.0123456789"),
)


class _DuplicateKey(Exception):
    def __init__(self, key: str, first_line: int, line: int) -> None:
        super().__init__(key, first_line, line)
        self.key, self.first_line, self.line = key, first_line, line


def read_yaml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a YAML file whose top level is a mapping.

    Raises
    ------
    UserError
        The file is missing, is no UTF-8 text, is no YAML, holds a key twice, or its top level is no mapping.
    """
    try:
        with open(path, encoding="utf-8") as stream:
            document = yaml.load(stream, Loader=_Loader)
    except OSError as error:
        raise UserError(path, f"cannot be read: {error.strerror}", "Check the path and the permissions") from error
    except UnicodeDecodeError as error:
        raise UserError(path, "is not a UTF-8 text", "Save the file as UTF-8") from error
    except _DuplicateKey as error:
        reason = f"the key {error.key!r} stands twice, in lines {error.first_line} and {error.line}"
        raise UserError(path, reason, "Keep one of the two") from error
    except yaml.YAMLError as error:
        raise UserError(path, f"is not valid YAML: {_yaml_problem(error)}", "Mend the syntax at that place") from error
    if not isinstance(document, dict):
        raise UserError(
            path,
            f"its top level is {_describe(document)}; expected a mapping (keys and values)",
            "Start from one of the examples in config/",
        )
    return document


def _yaml_problem(error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or str(error).splitlines()[0]
    return f"{problem} (line {mark.line + 1}, column {mark.column + 1})" if mark else str(problem)


@cache
def load_schema(package: str, name: str) -> dict[str, Any]:
    """JSON schema `name` that ships in ``package/schemas/``, e.g. ``("fusetune.design", "study")``."""
    text = resources.files(package).joinpath("schemas", f"{name}.schema.yaml").read_text(encoding="utf-8")
    schema: dict[str, Any] = yaml.safe_load(text)
    return schema


def validate(document: Mapping[str, Any], schema: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Check a document against a JSON schema.

    Raises
    ------
    UserError
        Names every key at fault with what was found and what was expected.
    """
    validator = jsonschema.Draft202012Validator(schema)
    errors = sorted(validator.iter_errors(document), key=lambda error: [str(part) for part in error.absolute_path])
    problems = [problem for error in errors for problem in _problems(error)]
    raise_problems(
        path, problems, "Mend the named keys; config/README.md and the examples beside it show what may stand there"
    )


def raise_problems(path: str | os.PathLike[str], problems: Iterable[str], remedy: str) -> None:
    """Raise one `UserError` that tells all problems found in a file; do nothing where there is none."""
    found = list(dict.fromkeys(problems))
    if not found:
        return
    shown = found[:MOST_PROBLEMS_SHOWN]
    if len(found) > len(shown):
        shown.append(f"and {len(found) - len(shown)} more")
    raise UserError(path, "; ".join(shown), remedy)


def nearest(name: str, candidates: Iterable[str]) -> str:
    """A hint ``" (did you mean 'X'?)"`` for a name that is not among the candidates; empty where none is near."""
    matches = difflib.get_close_matches(name, list(candidates), n=1, cutoff=0.6)
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
        known = list(schema.get("properties", {}))
        unknown = [str(key) for key in _keys(error.instance) if key not in known]
        return [
            f"{prefix}unknown key {key!r}{nearest(key, known)}; expected one of {', '.join(known)}" for key in unknown
        ]
    if error.validator == "required":
        missing = [key for key in _keys(error.validator_value) if key not in _keys(error.instance)]
        return [f"{prefix}the key {key!r} is missing; expected {_expected_of(schema, key)}" for key in missing]
    if error.validator == "not":
        return [f"{prefix}{schema.get('description', 'is not allowed here')}"]
    if error.validator == "propertyNames":
        return [f"{prefix}the key {error.instance!r} is not a valid name; expected {_expected(schema)}"]
    return [f"{place or 'top level'} is {_describe(error.instance)}; expected {_expected(schema)}"]


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


def _describe(value: object) -> str:
    """A value that was found, short enough for a message."""
    if value is None:
        return "empty"
    if isinstance(value, dict):
        return "a mapping with the keys " + ", ".join(str(key) for key in value) if value else "an empty mapping"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, bool):
        return "true" if value else "false"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}…"
