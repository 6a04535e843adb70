"""Designs of linear models: what their files may hold, and the covariances that follow."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from fusetune.design.covariance.changes import Sweep, Value, Variation, changed, factor_of, switched
from fusetune.design.covariance.evaluation import (
    DELAY,
    NOISE,
    RATE,
    WITHOUT,
    Alternative,
    Deviation,
    Deviations,
    alternatives,
)
from fusetune.design.covariance.linear_covariance import (
    NoCommonPeriodError,
    NoSteadyStateError,
    covariance_before_correction,
)
from fusetune.design.covariance.linear_model import LinearModel, LinearSensor, State
from fusetune.design.covariance.marker_landing import MarkerLanding, marker_landing
from fusetune.design.names import NAME_PATTERN
from fusetune.errors import UserError
from fusetune.settings.checking import nearest, raise_problems, validate
from fusetune.settings.declaration import built, required, setting
from fusetune.settings.schema import schema_of
from fusetune.storage.files import AnyPath

Array = npt.NDArray[np.float64]
Matrix = tuple[tuple[float, ...], ...]

WORD_PATTERN = "^[A-Za-z_][A-Za-z0-9_]{0,31}$"
_REMEDY = "Mend the named keys; config/covariance/ holds examples, docs/covariance.md says what they mean"
LEAST_RATE_HZ, LARGEST_RATE_HZ = 0.01, 1e5
_ON_GRID = 1e-6
"""Share of a step by which a time of a discrete model may miss it."""

_MODELS: Mapping[str, tuple[type, Callable[[Any], LinearModel]]] = {"marker_landing": (MarkerLanding, marker_landing)}
"""By name: values, and the model that is made of them."""


@dataclass(frozen=True)
class _StateEntry:
    name: str = required("name of the state", pattern=WORD_PATTERN)
    unit: str = setting("", "its unit")


@dataclass(frozen=True)
class _NoiseEntry:
    """A white process noise: either its intensity and where it enters, or a whole matrix."""

    density: float | None = setting(None, "its intensity, per √Hz; of A_d its standard deviation per step", low=0)
    into: tuple[float, ...] = setting((), "by how much it enters each state")
    Q: Matrix = setting((), "or its covariance, per second; of A_d per step")


@dataclass(frozen=True)
class _SensorEntry:
    H: Matrix = required("what it measures of the states, a row each", at_least=1)
    R: Matrix = required("covariance of its noise", at_least=1)
    rate_hz: float = required("its rate", unit="Hz", low=LEAST_RATE_HZ, high=LARGEST_RATE_HZ)
    delay_ms: float = setting(0.0, "from the measurement to its arrival", unit="ms", low=0, high=10000)
    phase_ms: float = setting(0.0, "of its first measurement", unit="ms", low=0, high=10000)
    used: bool = setting(True, "whether it is used")


@dataclass(frozen=True)
class LinearFile:
    """What the file of a linear design may hold."""

    kind: Literal["linear"] = required("linear")
    name: str = required("name of the design", pattern=NAME_PATTERN)
    description: str = setting("", "what the design asks, in a sentence")
    model: Literal["marker_landing"] | None = setting(None, "a model known by name, instead of states and matrices")
    parameters: Mapping[str, float] = setting({}, "values of a model known by name", pattern=WORD_PATTERN)
    states: tuple[_StateEntry, ...] = setting((), "states in the order of the matrices")
    A: Matrix = setting((), "dx/dt = A x, per second")
    A_d: Matrix = setting((), "or the transition over a step")
    discretisation: Literal["euler", "exact"] = setting("exact", "how a step of A is taken: I + A h, or exp(A h)")
    step_rate_hz: float | None = setting(
        None, "steps of the propagation", unit="Hz", low=LEAST_RATE_HZ, high=LARGEST_RATE_HZ
    )
    noises: Mapping[str, _NoiseEntry] = setting({}, "process noises by name", pattern=WORD_PATTERN)
    sensors: Mapping[str, _SensorEntry] = setting({}, "sensors by name", pattern=WORD_PATTERN)
    P0: Matrix = setting((), "covariance at the start; without it the unit matrix")
    duration_s: float | None = setting(
        None, "for how long the recursion runs from P0; without it to the steady state", unit="s", above=0
    )
    before: str | None = setting(None, "sensor before whose corrections P is told; without it the slowest that is used")
    judged: tuple[str, ...] = setting((), "states by which improvements are judged; empty: all")
    variations: tuple[Variation, ...] = setting((), "what could be otherwise")
    sweeps: tuple[Sweep, ...] = setting((), "curves")


@dataclass(frozen=True)
class LinearDesign:
    """A design of a linear model; see `fusetune.design.covariance.evaluation.Design`."""

    file: AnyPath
    name: str
    model: LinearModel
    named: Any = None
    """Values of a model known by name, which can be changed, too; None for one of matrices."""
    build: Callable[[Any], LinearModel] | None = None
    duration_s: float | None = None
    before: str | None = None
    judged: tuple[str, ...] = ()
    variations: tuple[Variation, ...] = ()
    sweeps: tuple[Sweep, ...] = field(default=())

    def alternatives(self) -> Iterator[Alternative]:
        """Of each noise, and of each sensor that is used."""
        for noise in self.model.noises:
            yield from alternatives(noise, (NOISE,))
        used = self.model.sensors_on
        for name, sensor in used.items():
            subjects = (NOISE, RATE, *((DELAY,) if sensor.delay_s else ()), *((WITHOUT,) if len(used) > 1 else ()))
            yield from alternatives(name, subjects)

    def deviations(self, changes: Mapping[str, Value]) -> Deviations:
        """Of every state after some changes."""
        told = ", ".join(f"{name}: {change}" for name, change in changes.items()) or "as designed"
        model = self.changed(changes)
        used = model.sensors_on
        if not used:
            raise UserError(self.file, f"{told}: no sensor is left", "Leave one in use")
        before = self.before if self.before in used else min(used, key=lambda name: used[name].rate_hz)
        try:
            P = covariance_before_correction(model, before, self.duration_s)
        except NoSteadyStateError as error:
            remedy = "Give duration_s, or a sensor that tells of every state"
            raise UserError(self.file, f"{told}: {error}", remedy) from error
        except NoCommonPeriodError as error:
            remedy = "Round the rates, so that they have a common period of seconds"
            raise UserError(self.file, f"{told}: {error}", remedy) from error
        sd = np.sqrt(np.diag(P))
        return {state.name: Deviation(state.unit, float(sd[i])) for i, state in enumerate(model.states)}

    def notes(self) -> Iterator[str]:
        """None: all is in the figures."""
        return iter(())

    def changed(self, changes: Mapping[str, Value]) -> LinearModel:
        """The model after some changes.

        Raises
        ------
        UserError
            A change names nothing that the model has, or a value that cannot be.
        """
        model, named = self.model, self.named
        of_model = {name: change for name, change in changes.items() if named is not None and hasattr(named, name)}
        try:
            if of_model and self.build is not None:
                values = {name: changed(getattr(named, name), change) for name, change in of_model.items()}
                validate(values, schema_of(type(named)), self.file)
                model = self.build(replace(named, **values))
            for name, change in changes.items():
                if name not in of_model:
                    model = self._with(model, name, change)
        except ValueError as error:
            raise UserError(self.file, f"changes ({', '.join(changes)}) {error}", _REMEDY) from error
        raise_problems(self.file, _grid_problems(model), _REMEDY)
        return model

    def _with(self, model: LinearModel, path: str, change: Value) -> LinearModel:
        if path == "step_rate_hz" and not model.is_discrete:
            return replace(model, step_rate_hz=_rate(changed(model.step_rate_hz, change)))
        name, _, what = path.partition(".")
        if name in model.noises and what == "sd":
            return replace(model, noises={**model.noises, name: model.noises[name] * factor_of(change) ** 2})
        if name in model.sensors and what in _SENSOR_CHANGES:
            sensor = _SENSOR_CHANGES[what](model.sensors[name], change)
            return replace(model, sensors={**model.sensors, name: sensor})
        known = [f"{noise}.sd" for noise in model.noises]
        known += [f"{sensor}.{one}" for sensor in model.sensors for one in _SENSOR_CHANGES]
        known += [each.name for each in fields(self.named)] if self.named is not None else []
        raise UserError(self.file, f"{path!r} is nothing that can change{nearest(path, known)}", _REMEDY)


def _rate(value: float) -> float:
    if not LEAST_RATE_HZ <= value <= LARGEST_RATE_HZ:
        raise ValueError(f"lead to {value:g} Hz; expected {LEAST_RATE_HZ:g} to {LARGEST_RATE_HZ:g}")
    return value


def _seconds(time_s: float, change: Value) -> float:
    """A time that is told in milliseconds, after a change."""
    value = changed(time_s * 1e3, change)
    if not value >= 0.0:
        raise ValueError(f"lead to {value:g} ms; expected 0 or more")
    return value * 1e-3


_SENSOR_CHANGES: Mapping[str, Callable[[LinearSensor, Value], LinearSensor]] = {
    "sd": lambda sensor, change: replace(sensor, R=sensor.R * factor_of(change) ** 2),
    "rate_hz": lambda sensor, change: replace(sensor, rate_hz=_rate(changed(sensor.rate_hz, change))),
    "delay_ms": lambda sensor, change: replace(sensor, delay_s=_seconds(sensor.delay_s, change)),
    "phase_ms": lambda sensor, change: replace(sensor, phase_s=_seconds(sensor.phase_s, change)),
    "used": lambda sensor, change: replace(sensor, on=switched(change)),
}  # fmt: skip


def linear_design(document: Mapping[str, Any], file: AnyPath) -> LinearDesign:
    """A linear design from its file's content.

    Raises
    ------
    UserError
        Names every key at fault with what was found and what was expected.
    """
    validate(document, schema_of(LinearFile), file)
    given = built(LinearFile, document)
    raise_problems(file, _contradictions(given), _REMEDY)
    named: Any = None
    build = None
    if given.model is not None:
        kind, build = _MODELS[given.model]
        validate(given.parameters, schema_of(kind), file)
        named = built(kind, given.parameters)
        model = build(named)
    else:
        raise_problems(file, _shape_problems(given), _REMEDY)
        model = _model_of(given)
    if given.step_rate_hz is not None:
        model = replace(model, step_rate_hz=given.step_rate_hz)
    names = tuple(state.name for state in model.states)
    raise_problems(file, _grid_problems(model), _REMEDY)
    asked = {"judged": given.judged} | {f"sweep {one.name}": one.states for one in given.sweeps}
    raise_problems(file, _unknown_states(asked, names), _REMEDY)
    if given.before is not None and given.before not in model.sensors:
        raise UserError(file, f"before is {given.before!r}; expected one of {', '.join(model.sensors)}", _REMEDY)
    return LinearDesign(
        file=file,
        name=given.name,
        model=model,
        named=named,
        build=build,
        duration_s=given.duration_s,
        before=given.before,
        judged=given.judged or names,
        variations=given.variations,
        sweeps=given.sweeps,
    )


def _unknown_states(asked: Mapping[str, tuple[str, ...]], known: tuple[str, ...]) -> Iterator[str]:
    for place, names in asked.items():
        for name in names:
            if name not in known:
                yield f"{place}: {name!r} is no state{nearest(name, known)}; expected one of {', '.join(known)}"


def _contradictions(given: LinearFile) -> Iterator[str]:
    for sweep in given.sweeps:
        yield from sweep.problems()
    matrices = [key for key in ("states", "A", "A_d", "noises", "sensors", "P0") if getattr(given, key)]
    if given.model is not None:
        if matrices:
            yield f"{matrices[0]}: the model {given.model} has its own; expected either a model or matrices"
        return
    if given.parameters:
        yield "parameters: there is no model that they could belong to; expected model"
    if bool(given.A) == bool(given.A_d):
        yield "A, A_d: expected one of them"
    for key in ("states", "sensors"):
        if not getattr(given, key):
            yield f"the key {key!r} is missing; expected {key} of the model"
    if given.step_rate_hz is None:
        yield "the key 'step_rate_hz' is missing; expected the rate of the propagation"


def _shape_problems(given: LinearFile) -> Iterator[str]:
    n = len(given.states)
    if len({state.name for state in given.states}) < n:
        yield "states: a name stands more than once"
    for key in ("A", "A_d", "P0"):
        matrix = getattr(given, key)
        if matrix:
            yield from _shape_problem(key, matrix, n, n)
    yield from _covariance_problem("P0", given.P0)
    for name, noise in given.noises.items():
        place = f"noises.{name}"
        if bool(noise.Q) == (noise.density is not None):
            yield f"{place}: expected either density (with into) or Q"
        elif noise.Q:
            yield from _shape_problem(f"{place}.Q", noise.Q, n, n)
            yield from _covariance_problem(f"{place}.Q", noise.Q)
        elif len(noise.into) != n:
            yield f"{place}.into has {len(noise.into)} values; expected {n}, one for each state"
    for name, sensor in given.sensors.items():
        rows = len(sensor.H)
        if name in given.noises:
            yield f"sensors.{name}: a noise has that name; expected another"
        yield from _shape_problem(f"sensors.{name}.H", sensor.H, rows, n)
        yield from _shape_problem(f"sensors.{name}.R", sensor.R, rows, rows)
        yield from _covariance_problem(f"sensors.{name}.R", sensor.R, regular=True)


def _shape_problem(place: str, matrix: Matrix, rows: int, columns: int) -> Iterator[str]:
    if len(matrix) != rows or any(len(row) != columns for row in matrix):
        yield f"{place} is no matrix of {rows} rows and {columns} columns"


def _covariance_problem(place: str, matrix: Matrix, *, regular: bool = False) -> Iterator[str]:
    if not matrix or any(len(row) != len(matrix) for row in matrix):
        return
    values = np.array(matrix)
    if not np.allclose(values, values.T):
        yield f"{place} is not symmetric; expected a covariance"
        return
    least, largest = np.linalg.eigvalsh(values)[[0, -1]]
    if least < -1e-12 * max(largest, 1.0) or (regular and not least > 0.0):
        yield f"{place} has the eigenvalue {least:.3g}; expected {'more than 0' if regular else '0 or more'}"


def _model_of(given: LinearFile) -> LinearModel:
    n = len(given.states)
    noises = {}
    for name, noise in given.noises.items():
        into = np.array(noise.into)
        noises[name] = np.array(noise.Q) if noise.Q else (noise.density or 0.0) ** 2 * np.outer(into, into)
    return LinearModel(
        states=tuple(State(one.name, one.unit) for one in given.states),
        A=np.array(given.A_d or given.A),
        step_rate_hz=given.step_rate_hz or math.nan,
        noises=noises,
        sensors={
            name: LinearSensor(
                np.array(one.H),
                np.array(one.R),
                one.rate_hz,
                one.delay_ms * 1e-3,
                one.phase_ms * 1e-3,
                one.used,
            )
            for name, one in given.sensors.items()
        },
        P0=np.array(given.P0) if given.P0 else np.eye(n),
        is_discrete=bool(given.A_d),
        is_exact=given.discretisation == "exact",
    )


def _grid_problems(model: LinearModel) -> Iterator[str]:
    """Times of a discrete model that are no whole steps."""
    if not model.is_discrete:
        return
    for name, sensor in model.sensors_on.items():
        for what, time_s in (
            ("period", 1.0 / sensor.rate_hz),
            ("delay", sensor.delay_s),
            ("phase", sensor.phase_s),
        ):
            steps = time_s * model.step_rate_hz
            if abs(steps - round(steps)) > _ON_GRID:
                yield f"sensors.{name}: its {what} is {steps:.6g} steps of A_d; expected a whole number, or A"
