"""Which delays that PX4 is told are wrong, from all flights together.

Flights are joined as in a random-effects analysis (`analyze/metrics/random_effects`): their delays vary by more than
their own intervals say, and the interval of the mean is that of Student's t over the flights. A delay is wrong where
the whole interval lies further from the told value than what matters: EKF2 acts on delays in steps of an update, 10 ms.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.special import stdtrit

from fusetune.analyze.delays.sensor_delays import CONFIDENCE, SensorDelay, read_delays
from fusetune.analyze.delays.settings import DelaySettings
from fusetune.analyze.metrics.random_effects import random_effects
from fusetune.design.tunable_parameters import DELAY_LIMIT, reach_ms
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.save.flights_table import of_same_vehicle
from fusetune.storage.documents import read_as, read_document, write_document
from fusetune.storage.files import AnyPath, atomic_path

STEP_MS = 10.0
"""A delay acts in steps of an update of the filter."""
FEWEST_FLIGHTS = 2
TRIED_SENSORS = ("gnss",)
"""Whose estimates were held against the truth (docs/delays.md); those of others are told, but nothing is mended by
them."""
LEAST_ERROR_MS = 2.0
"""Standard error that one flight has at least: stamps, and the update that takes a sample, are no finer."""


@dataclass(frozen=True)
class JoinedDelay:
    """Delay of one sensor of a vehicle.

    Attributes
    ----------
    sensor, parameter : as of `SensorDelay`
    told_ms : what PX4 is told now
    value_ms, lower_ms, upper_ms : mean over the flights and its interval (`CONFIDENCE`); of one flight, that of the
        flight
    flights : names of the flights behind it
    mended_ms : value to set, where the told one is proved wrong
    reach_ms : EKF2_DELAY_MAX now; None where the vehicle's release has none
    """

    sensor: str
    parameter: str
    told_ms: float
    value_ms: float
    lower_ms: float
    upper_ms: float
    flights: tuple[str, ...]
    mended_ms: float | None
    reach_ms: float | None

    @property
    def needed_ms(self) -> float | None:
        """EKF2_DELAY_MAX to set along with the mended value; None where it need not, or none can be."""
        if self.mended_ms is None or self.reach_ms is None:
            return None
        needed = reach_ms(self.mended_ms)
        return needed if needed > self.reach_ms else None

    @property
    def is_wrong(self) -> bool:
        """Whether the told delay is proved wrong."""
        return self.mended_ms is not None


def join_delays(
    flights: Mapping[str, Sequence[SensorDelay]], newest: str | None, settings: DelaySettings
) -> tuple[JoinedDelay, ...]:
    """Join the delays of all flights of a vehicle, sensor by sensor.

    Parameters
    ----------
    flights : name of each flight → what `sensor_delays` found
    newest : the flight whose parameters count as the present ones
    """
    found = []
    for sensor in dict.fromkeys(one.sensor for delays in flights.values() for one in delays):
        of_sensor = {name: one for name, delays in sorted(flights.items()) for one in delays if one.sensor == sensor}
        now = of_sensor.get(newest or "", list(of_sensor.values())[-1])
        value, lower, upper = joined(
            [one.value_ms for one in of_sensor.values()], [one.standard_error_ms for one in of_sensor.values()]
        )
        if len(of_sensor) == 1:
            lower, upper = now.lower_ms, now.upper_ms
        mended = None
        if len(of_sensor) >= FEWEST_FLIGHTS and sensor in TRIED_SENSORS:
            mended = _mended(now, value, max(lower - now.told_ms, now.told_ms - upper), settings)
        value, lower, upper = (round(one, 1) for one in (value, lower, upper))
        now_told = (sensor, now.parameter, now.told_ms)
        found.append(JoinedDelay(*now_told, value, lower, upper, tuple(of_sensor), mended, now.reach_ms))
    return tuple(found)


def _mended(now: SensorDelay, value: float, off_ms: float, settings: DelaySettings) -> float | None:
    if off_ms <= settings.matters_ms:
        return None
    limits = PARAMETERS[now.parameter]
    mended = STEP_MS * round(value / STEP_MS)
    mended = max(mended, limits.minimum) if limits.minimum is not None else mended
    mended = min(mended, limits.maximum) if limits.maximum is not None else mended
    return mended if abs(mended - now.told_ms) > settings.matters_ms else None


def joined(values: Sequence[float], errors: Sequence[float]) -> tuple[float, float, float]:
    """Mean of flights with their own standard errors, and its interval; infinite of a single flight."""
    found = random_effects(values, np.hypot(errors, LEAST_ERROR_MS))
    if not found.freedom:
        return found.mean, -np.inf, np.inf
    half = float(stdtrit(found.freedom, 0.5 + 0.5 * CONFIDENCE)) * found.standard_error
    return found.mean, found.mean - half, found.mean + half


def mended_values(delays: Iterable[JoinedDelay]) -> dict[str, float]:
    """Parameters of the delays that are proved wrong → values to set, and EKF2_DELAY_MAX where they need it longer."""
    known = list(delays)
    needed = [one.needed_ms for one in known if one.needed_ms is not None]
    mended = {one.parameter: one.mended_ms for one in known if one.mended_ms is not None}
    return mended | ({DELAY_LIMIT: max(needed)} if needed else {})


def write_joined(
    files: Mapping[str, AnyPath],
    newest: str | None,
    settings: DelaySettings,
    output: AnyPath,
    *,
    flights_table: AnyPath | None = None,
) -> tuple[JoinedDelay, ...]:
    """Join the `delays.json` of flights, by name, and write what was found as JSON.

    Parameters
    ----------
    newest : the flight whose parameters count as the present ones
    flights_table : `results/save/flights.parquet`, by which flights of other vehicles are left out; None leaves none
    """
    if flights_table is not None:
        files = {name: files[name] for name in of_same_vehicle(flights_table, files, newest)}
    flights = {name: read_delays(read_document(file)["delays"]) for name, file in files.items()}
    found = join_delays(flights, newest, settings)
    with atomic_path(output) as temporary:
        write_document(temporary, {"delays": [asdict(one) for one in found], "mended": mended_values(found)})
    return found


def read_joined(file: AnyPath) -> tuple[JoinedDelay, ...]:
    """Read what `write_joined` wrote.

    Raises
    ------
    UserError
        There is none, or it cannot be read.
    """
    return read_as(file, _delays_of, "what delays the sensors have")


def _delays_of(document: dict[str, Any]) -> tuple[JoinedDelay, ...]:
    return tuple(JoinedDelay(**one | {"flights": tuple(one["flights"])}) for one in document["delays"])
