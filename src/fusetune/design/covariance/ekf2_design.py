"""Designs for EKF2: what their files may hold, and the covariances that follow along a track."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from fusetune.design.covariance.changes import Sweep, Value, Variation, changed, factor_of, switched
from fusetune.design.covariance.ekf2_covariance import CovarianceAlong, covariance_along
from fusetune.design.covariance.ekf2_sensors import (
    DESIGNED,
    PROCESS_NOISES,
    SENSOR_NOISES,
    Ekf2Sensor,
    told_parameters,
)
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
from fusetune.design.covariance.perfect_flight import perfect_flight
from fusetune.design.covariance.track import Track
from fusetune.design.names import NAME_PATTERN
from fusetune.design.parameter_check import PARAMETER_PATTERN, parameter_problem, typed_values
from fusetune.ekf2.filter.common.state import ERROR_STATE_BLOCKS
from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.running.workflow_files import file_or_packaged
from fusetune.settings.checking import nearest, raise_problems, validate
from fusetune.settings.declaration import built, required, setting
from fusetune.settings.schema import schema_of
from fusetune.storage.files import AnyPath

_REMEDY = "Mend the named keys; config/covariance/ holds examples, docs/covariance.md says what they mean"
FEW_REFUSED = 0.005
"""Share of the measurements that may be refused without a word."""
_DEG = float(np.degrees(1.0))

GROUPS: Mapping[str, tuple[str, float, tuple[tuple[str, int], ...]]] = {
    "position_horizontal": ("m", 1.0, (("position", 0), ("position", 1))),
    "position_vertical": ("m", 1.0, (("position", 2),)),
    "velocity_horizontal": ("m/s", 1.0, (("velocity", 0), ("velocity", 1))),
    "velocity_vertical": ("m/s", 1.0, (("velocity", 2),)),
    "tilt": ("deg", _DEG, (("attitude", 0), ("attitude", 1))),
    "yaw": ("deg", _DEG, (("attitude", 2),)),
}
"""By name: unit, factor, and the states whose variances are summed."""

_AXES = {
    "attitude": ("n", "e", "d"), "velocity": ("n", "e", "d"), "position": ("n", "e", "d"),
    "gyro_bias": ("x", "y", "z"), "accel_bias": ("x", "y", "z"), "mag_earth": ("n", "e", "d"),
    "mag_body": ("x", "y", "z"), "wind": ("n", "e"),
}  # fmt: skip
_UNITS = {
    "attitude": ("deg", _DEG), "velocity": ("m/s", 1.0), "position": ("m", 1.0), "gyro_bias": ("rad/s", 1.0),
    "accel_bias": ("m/s^2", 1.0), "mag_earth": ("gauss", 1.0), "mag_body": ("gauss", 1.0), "wind": ("m/s", 1.0),
}  # fmt: skip


@dataclass(frozen=True)
class Ekf2File:
    """What the file of a design for EKF2 may hold."""

    kind: Literal["ekf2"] = required("ekf2")
    name: str = required("name of the design", pattern=NAME_PATTERN)
    sensors: Mapping[str, Ekf2Sensor] = required("sensors by name", choices=DESIGNED, at_least=1)
    description: str = setting("", "what the design asks, in a sentence")
    mission: str | None = setting(None, "file of the mission that is flown, with vehicle", at_least=1)
    vehicle: str | None = setting(None, "file of the simulated vehicle that flies it", at_least=1)
    seed: int = setting(1, "seed of its gusts", low=0)
    log: str | None = setting(None, "or log of a flight whose way is taken", at_least=1)
    settle_s: float = setting(20.0, "of the time in the air that is left out at its beginning", unit="s", low=0)
    parameters: Mapping[str, float] = setting(
        {}, "EKF2's parameters, noises of the sensors among them; others have PX4's defaults", pattern=PARAMETER_PATTERN
    )
    judged: tuple[str, ...] = setting(
        tuple(GROUPS), "states by which improvements are judged", choices=tuple(GROUPS), at_least=1
    )
    variations: tuple[Variation, ...] = setting((), "what could be otherwise")
    sweeps: tuple[Sweep, ...] = setting((), "curves")

    def problems(self) -> Iterator[str]:
        """Where the way comes from neither or both, and what no single key tells."""
        if (self.log is None) == (self.mission is None):
            yield "mission, log: expected one of them"
        if (self.vehicle is None) != (self.mission is None):
            yield "mission, vehicle: expected both or none"
        for name, value in self.parameters.items():
            problem = parameter_problem(name, value)
            if problem:
                yield f"parameters: {problem}"
        for sweep in self.sweeps:
            yield from sweep.problems()
            for state in sweep.states:
                if state not in GROUPS:
                    yield f"sweep {sweep.name}: {state!r} is no state{nearest(state, GROUPS)}; " + (
                        f"expected one of {', '.join(GROUPS)}"
                    )


@dataclass(frozen=True)
class Settings:
    """Sensors and parameters of a design, or of a variation of it."""

    sensors: Mapping[str, Ekf2Sensor]
    parameters: Mapping[str, float]
    """Those that differ from PX4's defaults."""


@dataclass(frozen=True)
class MissionWay:
    """Files of a mission and of the simulated vehicle that flies it, and the seed of its gusts."""

    mission: str
    vehicle: str
    seed: int = 1


@dataclass(frozen=True)
class LoggedWay:
    """The log of a flight."""

    log: str


@dataclass(frozen=True)
class Ekf2Design:
    """A design for EKF2; see `fusetune.design.covariance.evaluation.Design`."""

    file: AnyPath
    name: str
    settings: Settings
    way: LoggedWay | MissionWay
    settle_s: float = 20.0
    judged: tuple[str, ...] = tuple(GROUPS)
    variations: tuple[Variation, ...] = ()
    sweeps: tuple[Sweep, ...] = ()
    track: Track | None = field(default=None)
    """Given before anything is evaluated."""

    def alternatives(self) -> Iterator[Alternative]:
        """Of gyro, accelerometer and each sensor that is used; PX4 may not take all of them."""
        for name in ("gyro", "accelerometer"):
            yield from alternatives(name, (NOISE,))
        for name, sensor in self.settings.sensors.items():
            if sensor.used:
                yield from alternatives(name, (NOISE, RATE, *((DELAY,) if sensor.delay_ms else ()), WITHOUT))

    def deviations(self, changes: Mapping[str, Value]) -> Deviations:
        """Of every state after some changes; along the track, in the air, settled."""
        return deviations_of(self.along(self.changed(changes)))

    def notes(self) -> Iterator[str]:
        """Whether the filter refused measurements that are as exact as the way."""
        refused = self.along(self.settings).rejected
        if refused > FEW_REFUSED:
            yield (
                f"EKF2 refused {100.0 * refused:.0f} % of the measurements along the way, so the figures hold for a "
                "filter that does: the way jumps, or its IMU does not go with it"
            )

    def along(self, settings: Settings) -> CovarianceAlong:
        """The covariances along the track.

        Raises
        ------
        UserError
            The vehicle is not long enough in the air, or EKF2 does not run there.
        """
        if self.track is None:
            raise ValueError("a design has no covariances before it has a track")
        told = told_parameters(settings.sensors, settings.parameters)
        window_us = _window(self.track, self.settle_s, self.file)
        try:
            return covariance_along(perfect_flight(self.track, settings.sensors, told), told, window_us)
        except ValueError as error:
            reason = f"{error} of {self.track.name}"
            raise UserError(self.file, reason, "Take a longer flight, or one that begins on the ground") from error

    def changed(self, changes: Mapping[str, Value]) -> Settings:
        """Sensors and parameters after some changes.

        Raises
        ------
        UserError
            A change names nothing that there is, or a value that PX4 or the design does not take.
        """
        settings = self.settings
        try:
            for path, change in changes.items():
                settings = self._with(settings, path, change)
        except ValueError as error:
            raise UserError(self.file, f"changes ({', '.join(changes)}) {error}", _REMEDY) from error
        problems = [parameter_problem(name, value) for name, value in settings.parameters.items()]
        raise_problems(self.file, [problem for problem in problems if problem], _REMEDY)
        for sensor in settings.sensors.values():
            validate(vars(sensor), schema_of(Ekf2Sensor), self.file)
        return replace(settings, parameters=typed_values(settings.parameters))

    def _with(self, settings: Settings, path: str, change: Value) -> Settings:
        name, _, what = path.partition(".")
        if path in PARAMETERS:
            return _with_parameters(settings, {path: changed(_value(settings, path), change)})
        noises = {**SENSOR_NOISES, **PROCESS_NOISES}
        if what == "sd" and name in noises and (name in settings.sensors or name in PROCESS_NOISES):
            factor = factor_of(change)
            return _with_parameters(settings, {one: factor * _value(settings, one) for one in noises[name]})
        if name in settings.sensors and what in ("rate_hz", "delay_ms", "used"):
            sensor = _changed_sensor(settings.sensors[name], what, change)
            return replace(settings, sensors={**settings.sensors, name: sensor})
        known = [f"{one}.{word}" for one in settings.sensors for word in ("sd", "rate_hz", "delay_ms", "used")]
        known += [*(f"{one}.sd" for one in PROCESS_NOISES), *PARAMETERS]
        raise UserError(self.file, f"{path!r} is nothing that can change{nearest(path, known)}", _REMEDY)


def _changed_sensor(sensor: Ekf2Sensor, what: str, change: Value) -> Ekf2Sensor:
    if what == "used":
        return replace(sensor, used=switched(change))
    if what == "rate_hz":
        return replace(sensor, rate_hz=changed(sensor.rate_hz, change))
    return replace(sensor, delay_ms=changed(sensor.delay_ms, change))


def _value(settings: Settings, name: str) -> float:
    return float(settings.parameters.get(name, PARAMETERS[name].default))


def _with_parameters(settings: Settings, values: Mapping[str, float]) -> Settings:
    return replace(settings, parameters={**settings.parameters, **values})


def _window(track: Track, settle_s: float, file: AnyPath) -> tuple[int, int]:
    """From when the vehicle has been in the air for that long until it is no more, µs."""
    flown = track.timestamp_us[track.in_air]
    if not len(flown) or flown[-1] - flown[0] < settle_s * 1e6 + 2e6:
        seconds = (flown[-1] - flown[0]) * 1e-6 if len(flown) else 0.0
        reason = f"{track.name} is {seconds:.0f} s in the air, of which {settle_s:g} s are left out"
        raise UserError(file, reason, "Take a longer flight, or lower settle_s")
    return int(flown[0] + round(settle_s * 1e6)), int(flown[-1])


def deviations_of(along: CovarianceAlong) -> Deviations:
    """Groups first, then every state that the filter estimates."""
    found: dict[str, Deviation] = {}
    for name, (unit, factor, parts) in GROUPS.items():
        places = [ERROR_STATE_BLOCKS[block][0] + axis for block, axis in parts]
        found[name] = _deviation(along, places, unit, factor)
    for block, axes in _AXES.items():
        if (block == "wind" and not along.wind) or (block.startswith("mag_") and not along.field):
            continue
        unit, factor = _UNITS[block]
        for axis, word in enumerate(axes):
            found[f"{block}_{word}"] = _deviation(along, [ERROR_STATE_BLOCKS[block][0] + axis], unit, factor)
    return found


def _deviation(along: CovarianceAlong, places: list[int], unit: str, factor: float) -> Deviation:
    before, now = (P[:, places, places].sum(axis=1) for P in (along.before, along.now))
    return Deviation(
        unit,
        before=factor * float(np.sqrt(before.mean())),
        largest=factor * float(np.sqrt(before.max())),
        now=factor * float(np.sqrt(now.mean())),
    )


def ekf2_design(document: Mapping[str, Any], file: AnyPath) -> Ekf2Design:
    """A design for EKF2 from its file's content, as yet without track.

    Raises
    ------
    UserError
        Names every key at fault with what was found and what was expected.
    """
    validate(document, schema_of(Ekf2File), file)
    given = built(Ekf2File, document)
    raise_problems(file, given.problems(), _REMEDY)
    return Ekf2Design(
        file=file,
        name=given.name,
        settings=Settings(given.sensors, typed_values(given.parameters)),
        way=LoggedWay(given.log)
        if given.log
        else MissionWay(file_or_packaged(given.mission or ""), file_or_packaged(given.vehicle or ""), given.seed),
        settle_s=given.settle_s,
        judged=given.judged,
        variations=given.variations,
        sweeps=given.sweeps,
    )
