"""Reading a YAML file of settings: quickly, within bounds, and without the surprises of YAML 1.1.

Imports nothing heavier than PyYAML: the workflow reads configuration files whenever it starts.
"""

from __future__ import annotations

import os
import re
import stat
from itertools import islice
from typing import Any

import yaml

from fusetune.errors import UserError

MOST_BYTES = 500_000
MOST_VALUES = 50_000
"""Keys and values of a file, those that stand for a repeated part (``*name``) counted wherever they come to stand."""
DEEPEST = 20
"""Lists and mappings within each other."""
MOST_KEYS_SHOWN = 8

_PREFIX = "tag:yaml.org,2002:"
_OCTAL = re.compile(r"[-+]?0[0-9_]+$")
_EXAMPLES = "Start from one of the examples in config/"


class _Trouble(Exception):
    """What is wrong at a place of the file, and what to do about it."""

    def __init__(self, mark: yaml.Mark, reason: str, remedy: str) -> None:
        super().__init__(reason)
        self.place, self.reason, self.remedy = f"line {mark.line + 1}", reason, remedy


class _Loader(yaml.SafeLoader):
    """Safe YAML that is bounded, refuses what could be meant otherwise, and reads ``1e-3`` as the number it is.

    Refused are a key written twice, a key that is no text, numbers that YAML 1.1 reads in base 8 (``010``) or 60
    (``1:30``). Dates stay texts.
    """

    yaml_implicit_resolvers = {  # noqa: RUF012 - PyYAML's own way of telling a loader what plain texts mean
        first: [(tag, pattern) for tag, pattern in resolvers if not tag.endswith(":timestamp")]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.depth = 0
        self.extents: dict[int, tuple[int, int]] = {}
        """Number of values and depth of each node that is complete, by its identity."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose a node, unless it or what it repeats is too deep or too large."""
        mark = self.peek_event().start_mark
        repeats = self.check_event(yaml.AliasEvent)
        self.depth += 1
        if self.depth > DEEPEST:
            raise _too_deep(mark)
        node = super().compose_node(parent, index)
        self.depth -= 1
        if node is None:
            return None
        if not repeats:
            self.extents[id(node)] = self._extent(node)
        elif id(node) not in self.extents:
            raise _Trouble(mark, "a part repeats itself within itself", "Write it out")
        values, deep = self.extents[id(node)]
        if values > MOST_VALUES:
            raise _Trouble(mark, f"there are more than {MOST_VALUES} values up to here", "Make the file smaller")
        if self.depth + deep > DEEPEST:
            raise _too_deep(mark)
        return node

    def _extent(self, node: yaml.Node) -> tuple[int, int]:
        if isinstance(node, yaml.MappingNode):
            parts = [part for pair in node.value for part in pair]
        else:
            parts = node.value if isinstance(node, yaml.SequenceNode) else []
        inner = [self.extents[id(part)] for part in parts]
        return 1 + sum(values for values, _ in inner), 1 + max((deep for _, deep in inner), default=0)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Construct a mapping whose keys are texts, each written once."""
        first_line: dict[str, int] = {}
        for key_node, _ in node.value:
            mark, kind = key_node.start_mark, key_node.tag.removeprefix(_PREFIX)
            if kind not in ("str", "merge", "value"):
                what = key_node.value if isinstance(key_node, yaml.ScalarNode) else "written here"
                raise _Trouble(mark, f"the key {str(what)[:60]!r} is no text ({kind})", "Write it in quotes")
            if key_node.value in first_line:
                lines = f"lines {first_line[key_node.value]} and {mark.line + 1}"
                raise _Trouble(mark, f"the key {key_node.value[:60]!r} stands twice, in {lines}", "Keep one of the two")
            first_line[key_node.value] = mark.line + 1
        return super().construct_mapping(node, deep)

    def construct_number(self, node: yaml.ScalarNode) -> int | float:
        """Construct a number that can be read in one way only."""
        text = str(node.value)
        if ":" in text:
            reason = f"{text[:60]!r} is a number in base 60 to YAML"
            raise _Trouble(node.start_mark, reason, "Write the number in full, or a text in quotes")
        if node.tag == f"{_PREFIX}int" and _OCTAL.match(text):
            reason = f"{text[:60]!r} is a number in base 8 to YAML"
            raise _Trouble(node.start_mark, reason, "Leave out the leading zeros, or write a text in quotes")
        try:
            is_whole = node.tag == f"{_PREFIX}int"
            return self.construct_yaml_int(node) if is_whole else self.construct_yaml_float(node)
        except (ValueError, IndexError, OverflowError) as error:
            raise _Trouble(node.start_mark, f"{text[:20]!r} … is no usable number", "Mend the number") from error


_Loader.add_constructor(f"{_PREFIX}int", _Loader.construct_number)
_Loader.add_constructor(f"{_PREFIX}float", _Loader.construct_number)
# YAML 1.1 asks for a dot in a float, so PyYAML takes 1e-3 for a text.
_Loader.add_implicit_resolver(
    f"{_PREFIX}float",
    re.compile(r"^[-+]?(?:\d+(?:\.\d*)?|\.\d+)[eE][-+]?\d+$"),
    list("-+.0123456789"),
)


def _too_deep(mark: yaml.Mark) -> _Trouble:
    return _Trouble(mark, f"lists and mappings stand more than {DEEPEST} deep within each other", _EXAMPLES)


def read_yaml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a YAML file whose top level is a mapping.

    Raises
    ------
    UserError
        The file is missing, no regular file, too large, no UTF-8 text, no YAML, holds a key twice or a number that can
        be read in two ways, repeats parts (``*name``) beyond bounds, or its top level is no mapping.
    """
    text = _text_of(path)
    try:
        document = yaml.load(text, Loader=_Loader)
    except _Trouble as error:
        raise UserError(path, f"{error.place}: {error.reason}", error.remedy) from error
    except yaml.YAMLError as error:
        reason = f"is not valid YAML: {_yaml_problem(error, text)}"
        raise UserError(path, reason, "Mend the syntax at that place") from error
    except (ValueError, TypeError, LookupError, AttributeError) as error:
        # what PyYAML lets through when a value does not fit its explicit tag, as `!!int ""`
        reason = f"is not valid YAML: a value does not fit its tag ({error})"
        raise UserError(path, reason, "Leave tags (!!) out") from error
    if not isinstance(document, dict):
        reason = f"its top level is {describe(document)}; expected a mapping (keys and values)"
        raise UserError(path, reason, _EXAMPLES)
    return document


def value_of_text(text: str) -> Any:
    """What a text means where it is a value in a YAML file; one that is no YAML means itself."""
    try:
        return yaml.load(text, Loader=_Loader)
    except (_Trouble, yaml.YAMLError, ValueError, TypeError, LookupError, AttributeError):
        return text


def _text_of(path: str | os.PathLike[str]) -> str:
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise UserError(path, "is no regular file", "Name a file")
        with open(path, "rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise UserError(path, f"cannot be read: {error.strerror}", "Check the path and the permissions") from error
    except ValueError as error:  # a path with a null character
        raise UserError(repr(os.fspath(path)), f"is no path: {error}", "Mend the name of the file") from error
    if len(content) > MOST_BYTES:
        raise UserError(path, f"is larger than {MOST_BYTES // 1000} kB", "Check that it is the right file")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UserError(path, f"is not a UTF-8 text (byte {error.start})", "Save the file as UTF-8") from error


def _yaml_problem(error: yaml.YAMLError, text: str) -> str:
    if isinstance(error, yaml.reader.ReaderError):
        line = text.count("\n", 0, error.position) + 1
        return f"the character U+{ord(text[error.position]):04X} may not stand in it (line {line})"
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or str(error).splitlines()[0]
    return f"{problem} (line {mark.line + 1}, column {mark.column + 1})" if mark else str(problem)


def describe(value: object) -> str:
    """A value that was found, short enough for a message."""
    if value is None:
        return "empty"
    if isinstance(value, dict):
        keys = ", ".join(str(key) for key in islice(value, MOST_KEYS_SHOWN))
        return f"a mapping with the keys {keys}" if value else "an empty mapping"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, bool):
        return "true" if value else "false"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}…"
