"""What the repository holds of the configuration beside its declaration: a schema for editors, a file, a manual."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, asdict, is_dataclass
from typing import Any, Literal, get_args, get_origin

import yaml

from fusetune.configuration import Configuration
from fusetune.design.missions.shapes import KINDS as SHAPES
from fusetune.execute.sensors.faults import KINDS as FAULTS
from fusetune.settings.declaration import Declaration, DeclaredSetting, declared, meaning_of, without_none
from fusetune.settings.schema import DIALECT, schema_of

WIDTH = 120
_COUNTED = {2: "two", 3: "three"}


def schema_text() -> str:
    """`workflow/schemas/config.schema.yaml`."""
    # JSON has no names for parts that repeat, and no part of the schema is long
    schema = json.loads(
        json.dumps({"$schema": DIALECT, "title": "Configuration of the pipeline"} | schema_of(Configuration))
    )
    return "# Made from src/fusetune/configuration.py; for editors.\n" + yaml.safe_dump(
        schema, sort_keys=False, allow_unicode=True, width=WIDTH
    )


def configuration_text() -> str:
    """`config/config.yaml`: every setting with its default, what stands at the top level with its meaning."""
    parts = [
        "# yaml-language-server: $schema=../workflow/schemas/config.schema.yaml\n"
        "# Every key, its meaning, unit, range and default: config/README.md.\n"
    ]
    for one in declared(Configuration):
        values = "".join(_lines(one.name, _plain(one.default)))
        parts.append(f"{_comment(one.meaning)}\n{values}")
    return "\n".join(parts)


def manual_text(kind: type) -> str:
    """A table in `config/README.md`: the keys of a file that becomes this dataclass."""
    rows = ["| key | meaning | unit, range | default |", "|---|---|---|---|"]
    for place, one in leaves(kind):
        values = ", ".join(filter(None, (one.declaration.unit, _range_of(one))))
        default = "empty" if one.declaration.filled_in else _shown(one.default)
        rows.append(f"| `{place}` | {one.meaning} | {values} | {default} |")
    return "\n".join(row.replace("  ", " ") for row in rows)


def faults_text() -> str:
    """The table of faults in `config/README.md`."""
    return kinds_text(FAULTS, "what happens")


def shapes_text() -> str:
    """The table of shapes in `config/README.md`."""
    return kinds_text(SHAPES, "what is flown, and what it tells of")


def kinds_text(kinds: Mapping[str, type], meaning: str) -> str:
    """A table of the kinds that the entries of a list may be of."""
    rows = [f"| kind | {meaning} | keys, those in brackets may be left out |", "|---|---|---|"]
    for name, kind in kinds.items():
        keys = (f"`{one.name}`" if one.default is MISSING else f"[`{one.name}`]" for one in declared(kind))
        rows.append(f"| `{name}` | {meaning_of(kind)} | {', '.join(keys)} |")
    return "\n".join(rows)


def leaves(kind: type, place: str = "") -> Iterator[tuple[str, DeclaredSetting]]:
    """All settings with their places (`section.key`)."""
    for one in declared(kind):
        kind = without_none(one.kind)
        entry = next(iter(get_args(kind)), None)
        if is_dataclass(kind):
            yield from leaves(kind, f"{place}{one.name}.")  # type: ignore[arg-type]
        elif is_dataclass(entry):
            yield from leaves(entry, f"{place}{one.name}[].")  # type: ignore[arg-type]
        elif get_origin(kind) is Mapping and is_dataclass(get_args(kind)[1]):
            yield from leaves(get_args(kind)[1], f"{place}{one.name}.NAME.")
        else:
            yield f"{place}{one.name}", one


def _comment(meaning: str) -> str:
    sentence = f"{meaning[0].upper()}{meaning[1:]}.".replace("`", "")
    return textwrap.fill(sentence, WIDTH - 10, initial_indent="# ", subsequent_indent="# ")


def _plain(default: Any) -> Any:
    if is_dataclass(default) and not isinstance(default, type):
        settings = asdict(default)
        return {one.name: _plain(settings[one.name]) for one in declared(type(default))}
    return list(default) if isinstance(default, tuple) else default


def _lines(key: str, value: Any, indent: str = "") -> Iterator[str]:
    """Lines of YAML; a section is a block, and so is a list that does not fit into a line."""
    flow = yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=10_000).removesuffix("...\n").rstrip()
    line = f"{indent}{key}: {'' if value is None else flow}".rstrip()
    if isinstance(value, Mapping) and not indent:
        yield f"{key}:\n"
        for name, part in value.items():
            yield from _lines(name, part, "  ")
    elif isinstance(value, list) and len(line) > WIDTH:
        yield f"{indent}{key}:\n"
        yield from (f"{indent}  - {entry}\n" for entry in value)
    else:
        yield f"{line}\n"


def _range_of(one: DeclaredSetting) -> str:
    kind, declaration = without_none(one.kind), one.declaration
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is bool:
        return "true, false"
    if origin is Literal:
        return ", ".join(f"`{name}`" for name in arguments)
    if origin is tuple and declaration.choices:
        return "some of these" if one.default == declaration.choices else f"some of {_shown(declaration.choices)}"
    numbers = _numbers(declaration)
    if arguments[-1:] == (...,):
        return f"list {numbers}".strip()
    return f"{_COUNTED[len(arguments)]} numbers {numbers}".strip() if origin is tuple else numbers


def _numbers(declaration: Declaration) -> str:
    if declaration.above is not None:
        return f"above {declaration.above:g}" + (f", to {declaration.high:g}" if declaration.high else "")
    if declaration.low is None:
        return ""
    if declaration.high is None:
        return f"from {declaration.low:g}"
    between = " to " if declaration.low < 0 else "–"
    return f"{declaration.low:.12g}{between}{declaration.high:.12g}".replace("-", "−")


def _shown(default: Any) -> str:
    if default is MISSING:
        return "to be given"
    if isinstance(default, bool):
        return str(default).lower()
    if isinstance(default, Mapping):
        return ", ".join(f"`{key}`: {_shown(value)}" for key, value in default.items()) or "none"
    if isinstance(default, tuple):
        return ", ".join(_shown(one) for one in default) or "none"
    if default is None or default == "":
        return "empty"
    return f"`{default}`" if isinstance(default, str) else f"{default:.12g}"
