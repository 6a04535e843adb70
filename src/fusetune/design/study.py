"""Parameter studies: the named parameter sets that are compared.

The sets depend on the study file alone, but for those around the present values, which follow from the flights. Sets,
values or numbers of sets that are appended leave the sets before them as they are, with the same names: only what is
new has to be computed. docs/studies.md describes the kinds.
"""

from __future__ import annotations

import itertools
import math
import os
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from fusetune.design.constraints import CONSTRAINT_PATTERN, Constraint
from fusetune.design.factors import Factor
from fusetune.design.names import NAME_PATTERN, name_problem, one_line
from fusetune.design.newer_names import in_known_names
from fusetune.design.parameter_check import PARAMETER_PATTERN, parameter_problem, typed_values
from fusetune.design.parameter_sets import ParameterSet, short_name
from fusetune.design.sampling import points
from fusetune.design.search_settings import SEARCHED, SearchSettings
from fusetune.design.tunable_parameters import TUNABLE_PARAMETERS, USUALLY_VARIED, Scale
from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS, PARAMETERS, ParameterError
from fusetune.px4.releases import AUTO, BASELINE, Release, number_of_name
from fusetune.set_names import RESERVED_SET_NAMES
from fusetune.settings.checking import raise_problems, validate
from fusetune.settings.declaration import built, required, section, setting
from fusetune.settings.schema import schema_of
from fusetune.settings.yaml_reader import read_yaml

MOST_SETS = 2000
"""More sets than this are a slip of the pen: each is replayed on every flight."""

LONGEST_SET_NAME = 120
_CONSTRAINTS = "which of two parameters has to be smaller, `A < B` or `A <= B`; other sets are left out"
REMEDY = "Mend the named keys; the examples in config/studies/ show studies of every kind"


@dataclass(frozen=True)
class _StudyKind:
    kind: Literal["list", "one_at_a_time", "grid", "latin_hypercube", "sobol", "around_present", "search"] = required(
        "explicit sets, one parameter changed at a time, all combinations, two ways to fill the space between bounds, "
        "one step up and down from what the vehicle flies, or a search"
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


@dataclass(frozen=True, kw_only=True)
class _GridFile(_VariedFile):
    constraints: tuple[str, ...] = setting((), _CONSTRAINTS, pattern=CONSTRAINT_PATTERN)


@dataclass(frozen=True)
class _FactorEntry:
    """What a study that fills a space says of one parameter."""

    low: float | None = setting(None, "lowest value; without it the lower end of the sane range")
    high: float | None = setting(None, "highest value; without it the upper end of the sane range")
    scale: Scale | None = setting(None, "whether ratios or differences count; without it as the catalogue says")


@dataclass(frozen=True, kw_only=True)
class _SampledFile(_StudyFile):
    factors: Mapping[str, _FactorEntry] = required(
        "parameters and the bounds of each", pattern=PARAMETER_PATTERN, at_least=1
    )
    number: int = required("number of sets", low=1, high=MOST_SETS)
    seed: int = setting(1, "seed of the sequence; the same seed gives the same sets", low=0)
    constraints: tuple[str, ...] = setting((), _CONSTRAINTS, pattern=CONSTRAINT_PATTERN)


@dataclass(frozen=True, kw_only=True)
class _AroundFile(_StudyKind):
    name: str = required("name of the study", pattern=NAME_PATTERN)
    description: str = setting("", "what the study asks, in a sentence")
    parameters: tuple[str, ...] = setting(
        (),
        "parameters to vary where the flights exercise them; empty: those that usually matter",
        pattern=PARAMETER_PATTERN,
    )


@dataclass(frozen=True, kw_only=True)
class _SearchFile(_StudyKind):
    name: str = required("name of the study", pattern=NAME_PATTERN)
    description: str = setting("", "what the study asks, in a sentence")
    search: SearchSettings = section(SearchSettings)


_FILE_OF_KIND: Mapping[str, type] = {
    "list": _ListFile,
    "one_at_a_time": _VariedFile,
    "grid": _GridFile,
    "latin_hypercube": _SampledFile,
    "sobol": _SampledFile,
    "around_present": _AroundFile,
    "search": _SearchFile,
}


@dataclass(frozen=True)
class Study:
    """A parameter study."""

    name: str
    kind: str
    sets: tuple[ParameterSet, ...]
    description: str = ""
    around: tuple[str, ...] = ()
    """Parameters that are varied around the present values, which the flights tell; such a study has no sets yet."""
    search: SearchSettings | None = None
    """How a study searches; its sets are found on the flights."""

    @property
    def needs_flights(self) -> bool:
        """Whether what it compares follows from flights."""
        return bool(self.around or self.search)

    def set_named(self, name: str) -> ParameterSet:
        """The set of that name; raises `KeyError` where the study has none."""
        for parameter_set in self.sets:
            if parameter_set.name == name:
                return parameter_set
        raise KeyError(name)


def load_study(path: str | os.PathLike[str], release: str = AUTO) -> Study:
    """Read and check a study file; `UserError` as of `read_checked`, and for sets that cannot be told apart or set.

    Parameters
    ----------
    release : of PX4, whose parameters the study may name, as in the configuration. What newer releases only call
        otherwise is translated; what only some have can be compared where one of them is asked for.
    """
    replayed = BASELINE if release == AUTO else number_of_name(release)
    document = read_yaml(path)
    validate({key: document[key] for key in document if key == "kind"}, schema_of(_StudyKind), path)
    validate(document, schema_of(_FILE_OF_KIND[document["kind"]]), path)
    raise_problems(path, _size_problems(document), "Vary fewer parameters, or give them fewer values")
    try:
        document = in_known_names(document)
    except ParameterError as error:
        raise UserError(path, f"{error.name} {error.reason}", error.remedy) from error
    raise_problems(path, _parameter_problems(document, replayed), REMEDY)
    sets = tuple(_SETS_OF_KIND[document["kind"]](document))
    raise_problems(path, _name_problems(sets), REMEDY)
    if len(sets) < document.get("number", 0):
        reason = f"only {len(sets)} sets of {document['number']} keep the constraints"
        raise UserError(path, reason, "Loosen the constraints or widen the bounds")
    if not sets and document["kind"] not in ("around_present", "search"):
        raise UserError(path, "no set keeps the constraints", "Loosen them")
    around = (*document.get("parameters", ()),) or USUALLY_VARIED if document["kind"] == "around_present" else ()
    description = one_line(document.get("description", ""))
    search = built(SearchSettings, document.get("search", {})) if document["kind"] == "search" else None
    return Study(document["name"], document["kind"], sets, description, around, search)


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
        values = {name: vary[name][index] for name, index in zip(vary, indices, strict=True)}
        if _keeps_constraints(document, values):
            yield _varied_set(document, values)


def _sampled_sets(document: Mapping[str, Any]) -> Iterable[ParameterSet]:
    """The first so many points that keep the constraints; a name is the number of a set among these."""
    factors = [_factor(name, entry) for name, entry in document["factors"].items()]
    drawn = points(document["kind"], [one.parameter for one in factors], document.get("seed", _SampledFile.seed))
    sets = (
        values
        for point in drawn
        if _keeps_constraints(document, values := {f.parameter: _at(f, u) for f, u in zip(factors, point, strict=True)})
    )
    for number, values in enumerate(itertools.islice(sets, document["number"]), 1):
        described = ", ".join(f"{name} {value:g}" for name, value in values.items())
        overrides = {**typed_values(document.get("fixed", {})), **values}
        yield ParameterSet(f"{document['kind']}_{number:0{len(str(MOST_SETS))}}", overrides, described)


def _factor(name: str, entry: Mapping[str, Any]) -> Factor:
    known = TUNABLE_PARAMETERS.get(name)
    low, high, scale = _bounds(name, entry)
    middle = math.sqrt(low * high) if scale == "log" else (low + high) / 2.0
    return Factor(name, scale, low, high, middle, 2.0 if scale == "log" else 1.0, known.facts.grid if known else 0.0)


def _bounds(name: str, entry: Mapping[str, Any]) -> tuple[Any, Any, Scale]:
    """Bounds, None where neither study nor catalogue tells, and scale."""
    known = TUNABLE_PARAMETERS.get(name)
    low, high = known.sane_range({}) if known else (None, None)
    scale: Scale = known.facts.scale if known else "linear"
    given = {key: value for key, value in entry.items() if value is not None}
    return given.get("low", low), given.get("high", high), given.get("scale", scale)


def _at(factor: Factor, share: float) -> float:
    """Value at a share of the way from bound to bound, to four digits as long as that stays inside them."""
    first, last = factor.bounds
    value = factor.value(first + share * (last - first))
    rounded = float(f"{value:.4g}")
    return rounded if factor.low <= rounded <= factor.high else min(max(value, factor.low), factor.high)


def _keeps_constraints(document: Mapping[str, Any], values: Mapping[str, float]) -> bool:
    known = {**document.get("fixed", {}), **values}
    return all(Constraint.of(text).holds(known) for text in document.get("constraints", ()))


def _sets_of_flights(document: Mapping[str, Any]) -> Iterable[ParameterSet]:
    """None yet: they follow from the flights (`around_present.study_around`)."""
    return ()


_SETS_OF_KIND = {
    "list": _listed_sets,
    "one_at_a_time": _one_at_a_time_sets,
    "grid": _grid_sets,
    "latin_hypercube": _sampled_sets,
    "sobol": _sampled_sets,
    "around_present": _sets_of_flights,
    "search": _sets_of_flights,
}


def _varied_set(document: Mapping[str, Any], varied: Mapping[str, float]) -> ParameterSet:
    varied = typed_values(varied)
    name = "-".join(f"{short_name(parameter)}_{_value_text(value)}" for parameter, value in varied.items())
    description = ", ".join(f"{parameter} {value:g}" for parameter, value in varied.items())
    return ParameterSet(name, {**typed_values(document.get("fixed", {})), **varied}, description)


def _value_text(value: float) -> str:
    """A number as part of a file name: 0.35 → ``0p35``, −2 → ``m2``, 1e-05 → ``1em05``."""
    return format(value, ".9g").replace("+", "").replace("-", "m").replace(".", "p")


def _size_problems(document: Mapping[str, Any]) -> Iterable[str]:
    lengths = [len(values) for values in document.get("vary", {}).values()]
    sets = math.prod(lengths) if document["kind"] == "grid" else sum(lengths) + len(document.get("sets", ()))
    if sets > MOST_SETS:
        yield f"it makes {sets} sets; expected at most {MOST_SETS}"


def _parameter_problems(document: Mapping[str, Any], replayed: Release) -> Iterable[str]:
    for place, name, value in _parameters_with_places(document):
        problem = parameter_problem(name, value, replayed)
        if problem:
            yield f"{place}: {problem}"
    for key in ("vary", "factors"):
        for name in set(document.get("fixed", {})) & set(document.get(key, {})):
            yield f"{key}.{name}: the parameter is fixed too; expected it in only one of fixed and {key}"
    for name, values in document.get("vary", {}).items():
        for value in (value for value, count in Counter(values).items() if count > 1):
            yield f"vary.{name}: the value {value:g} stands more than once"
    for name, entry in document.get("factors", {}).items():
        yield from _factor_problems(name, entry, replayed)
    for name in document.get("parameters", ()):
        yield from _untunable(name, "parameters")
    yield from _search_problems(document.get("search", {}))
    known = {*document.get("fixed", {}), *document.get("vary", {}), *document.get("factors", {})}
    for text in document.get("constraints", ()):
        for name in {Constraint.of(text).smaller, Constraint.of(text).larger} - known:
            yield f"constraints ({text}): {name} is neither varied nor fixed, so its value is not known"


def _untunable(name: str, place: str) -> Iterable[str]:
    if name not in TUNABLE_PARAMETERS:
        problem = parameter_problem(name, 0.0) if name not in PARAMETERS else None
        yield f"{place}: {problem or f'{name} is none of those that are tuned, see docs/studies.md'}"


def _search_problems(search: Mapping[str, Any]) -> Iterable[str]:
    for name in search.get("parameters", ()):
        yield from _untunable(name, "search.parameters")
    searched = search.get("parameters") or SEARCHED
    for name, values in search.get("bounds", {}).items():
        place = f"search.bounds.{name}"
        if name not in searched:
            yield f"{place}: the parameter is not searched; expected one of {', '.join(searched)}"
        elif len(values) != 2 or not values[0] < values[1]:
            yield f"{place}: {', '.join(f'{one:g}' for one in values)}; expected the lowest value and the highest"
        else:
            yield from (f"{place}: {problem}" for one in values if (problem := parameter_problem(name, one)))


def _factor_problems(name: str, entry: Mapping[str, Any], replayed: Release) -> Iterable[str]:
    place = f"factors.{name}"
    low, high, scale = _bounds(name, entry)
    if name in ALL_PARAMETERS and ALL_PARAMETERS[name].type == "INT32":
        yield f"{place}: it is a whole number or a switch; expected it in a list or a grid"
        return
    if low is None or high is None:
        unknown = parameter_problem(name, 0.0, replayed) if name not in PARAMETERS else None
        yield f"{place}: {unknown or 'no sane range is known of it; expected low and high'}"
        return
    for value in (low, high):
        problem = parameter_problem(name, value, replayed)
        if problem:
            yield f"{place}: {problem}"
    if low >= high:
        yield f"{place}: low is {low:g} and high {high:g}; expected low below high"
    elif scale == "log" and low <= 0.0:
        yield f"{place}: low is {low:g}; expected it above 0 on a logarithmic scale"
    elif TUNABLE_PARAMETERS.get(name) and high - low < TUNABLE_PARAMETERS[name].facts.grid:
        yield f"{place}: no step of {TUNABLE_PARAMETERS[name].facts.grid:g} lies between {low:g} and {high:g}"


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
