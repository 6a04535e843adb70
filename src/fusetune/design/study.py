"""Parameter studies: the named parameter sets that are compared.

Three kinds: an explicit list of sets; one parameter at a time, each of its values a set; a grid of all
combinations. The sets depend on the study file alone, and values appended to a list, a parameter or the axes of a
grid leave the sets before them as they are, with the same names: only what is new has to be computed.
"""

from __future__ import annotations

import itertools
import math
import os
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from fusetune.design.names import NAME_PATTERN, name_problem, one_line
from fusetune.design.parameter_check import PARAMETER_PATTERN, parameter_problem, typed_values
from fusetune.set_names import RESERVED_SET_NAMES
from fusetune.settings.checking import raise_problems, validate
from fusetune.settings.declaration import required, setting
from fusetune.settings.schema import schema_of
from fusetune.settings.yaml_reader import read_yaml

MOST_SETS = 2000
"""More sets than this are a slip of the pen: each is replayed on every flight."""

LONGEST_SET_NAME = 120
REMEDY = "Mend the named keys; the examples in config/studies/ show studies of every kind"


@dataclass(frozen=True)
class _StudyKind:
    kind: Literal["list", "one_at_a_time", "grid"] = required(
        "explicit sets, one parameter changed at a time, or all combinations"
    )


@dataclass(frozen=True, kw_only=True)
class _StudyFile(_StudyKind):
    """What every study file may hold."""

    name: str = required("name of the study", pattern=NAME_PATTERN)
    description: str = setting("", "what the study asks, in a sentence")
    fixed: Mapping[str, float] = setting({}, "parameters that every set of the study has", pattern=PARAMETER_PATTERN)


@dataclass(frozen=True)
class _SetEntry:
    """A set of a study of kind list."""

    name: str = required("name of the set; letters, digits, _ and -; becomes a file name", pattern=NAME_PATTERN)
    parameters: Mapping[str, float] = required("parameter names and values", pattern=PARAMETER_PATTERN, at_least=1)
    description: str = setting("", "what the set stands for")


@dataclass(frozen=True, kw_only=True)
class _ListFile(_StudyFile):
    sets: tuple[_SetEntry, ...] = required("the sets, each with name and parameters", at_least=1)


@dataclass(frozen=True, kw_only=True)
class _VariedFile(_StudyFile):
    vary: Mapping[str, tuple[float, ...]] = required(
        "parameters and the values each is given", pattern=PARAMETER_PATTERN, at_least=1
    )


_FILE_OF_KIND = {"list": _ListFile, "one_at_a_time": _VariedFile, "grid": _VariedFile}


@dataclass(frozen=True)
class ParameterSet:
    """A named set of EKF2 parameters that differ from those of the log."""

    name: str
    overrides: dict[str, float]
    """Parameter name → value; `int` for INT32 parameters."""
    description: str = ""


@dataclass(frozen=True)
class Study:
    """A parameter study."""

    name: str
    kind: str
    sets: tuple[ParameterSet, ...]
    description: str = ""

    def set_named(self, name: str) -> ParameterSet:
        """The set of that name; raises `KeyError` where the study has none."""
        for parameter_set in self.sets:
            if parameter_set.name == name:
                return parameter_set
        raise KeyError(name)


def load_study(path: str | os.PathLike[str]) -> Study:
    """Read and check a study file; `UserError` as of `read_checked`, and for sets that cannot be told apart or set."""
    document = read_yaml(path)
    validate({key: document[key] for key in document if key == "kind"}, schema_of(_StudyKind), path)
    validate(document, schema_of(_FILE_OF_KIND[document["kind"]]), path)
    raise_problems(path, _size_problems(document), "Vary fewer parameters, or give them fewer values")
    raise_problems(path, _parameter_problems(document), REMEDY)
    sets = tuple(_SETS_OF_KIND[document["kind"]](document))
    raise_problems(path, _name_problems(sets), REMEDY)
    return Study(document["name"], document["kind"], sets, one_line(document.get("description", "")))


def _listed_sets(document: Mapping[str, Any]) -> Iterable[ParameterSet]:
    fixed = document.get("fixed", {})
    for entry in document["sets"]:
        overrides = typed_values({**fixed, **entry["parameters"]})
        yield ParameterSet(entry["name"], overrides, one_line(entry.get("description", "")))


def _one_at_a_time_sets(document: Mapping[str, Any]) -> Iterable[ParameterSet]:
    for parameter, values in document["vary"].items():
        for value in values:
            yield _varied_set(document, {parameter: value})


def _grid_sets(document: Mapping[str, Any]) -> Iterable[ParameterSet]:
    """All combinations, ordered by their largest value index.

    In this order a grid that grows along all its axes keeps its former sets as the first ones; row by row it would not.
    """
    vary = document["vary"]
    combinations = itertools.product(*(range(len(values)) for values in vary.values()))
    for indices in sorted(combinations, key=lambda combination: (max(combination), combination)):
        yield _varied_set(document, {name: vary[name][index] for name, index in zip(vary, indices, strict=True)})


_SETS_OF_KIND = {"list": _listed_sets, "one_at_a_time": _one_at_a_time_sets, "grid": _grid_sets}


def _varied_set(document: Mapping[str, Any], varied: Mapping[str, float]) -> ParameterSet:
    varied = typed_values(varied)
    name = "-".join(f"{_short(parameter)}_{_value_text(value)}" for parameter, value in varied.items())
    description = ", ".join(f"{parameter} {value:g}" for parameter, value in varied.items())
    return ParameterSet(name, {**typed_values(document.get("fixed", {})), **varied}, description)


def _short(parameter: str) -> str:
    return parameter.removeprefix("EKF2_").lower()


def _value_text(value: float) -> str:
    """A number as part of a file name: 0.35 → ``0p35``, −2 → ``m2``, 1e-05 → ``1em05``."""
    return format(value, ".9g").replace("+", "").replace("-", "m").replace(".", "p")


def _size_problems(document: Mapping[str, Any]) -> Iterable[str]:
    lengths = [len(values) for values in document.get("vary", {}).values()]
    sets = math.prod(lengths) if document["kind"] == "grid" else sum(lengths) + len(document.get("sets", ()))
    if sets > MOST_SETS:
        yield f"it makes {sets} sets; expected at most {MOST_SETS}"


def _parameter_problems(document: Mapping[str, Any]) -> Iterable[str]:
    for place, name, value in _parameters_with_places(document):
        problem = parameter_problem(name, value)
        if problem:
            yield f"{place}: {problem}"
    for name in set(document.get("fixed", {})) & set(document.get("vary", {})):
        yield f"vary.{name}: the parameter is fixed too; expected it in only one of fixed and vary"
    for name, values in document.get("vary", {}).items():
        for value in (value for value, count in Counter(values).items() if count > 1):
            yield f"vary.{name}: the value {value:g} stands more than once"


def _parameters_with_places(document: Mapping[str, Any]) -> Iterable[tuple[str, str, float]]:
    for name, value in document.get("fixed", {}).items():
        yield "fixed", name, value
    for index, entry in enumerate(document.get("sets", ())):
        for name, value in entry["parameters"].items():
            yield f"sets[{index}] ({entry['name']}).parameters", name, value
    for name, values in document.get("vary", {}).items():
        for index, value in enumerate(values):
            yield f"vary.{name}[{index}]", name, value


def _name_problems(sets: tuple[ParameterSet, ...]) -> Iterable[str]:
    seen: dict[str, str] = {}
    for index, parameter_set in enumerate(sets):
        name = parameter_set.name
        # File systems that ignore case would keep only one of two such sets.
        folded = name.casefold()
        problem = name_problem(name)
        if problem:
            yield f"sets[{index}].name: {problem}"
        if folded in RESERVED_SET_NAMES:
            yield f"sets[{index}].name: {name!r} is a name the product uses itself; expected another name"
        if folded in seen:
            yield f"sets[{index}].name: duplicate set name {name!r}; expected names that differ in more than case"
        if len(name) > LONGEST_SET_NAME:
            yield f"the set name {name!r} has {len(name)} characters; expected at most {LONGEST_SET_NAME} (vary fewer)"
        seen[folded] = name
