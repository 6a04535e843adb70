"""The sensors of one vehicle over several flights: their Allan curves as one, their distributions together.

From the documents that flights leave (`SensorNoise.document`), so that a fleet is pooled without its logs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusetune.analyze.sensor_noise.allan import AllanCurve, pooled_curve
from fusetune.analyze.sensor_noise.allan_fit import AllanFigures, allan_figures
from fusetune.analyze.sensor_noise.distribution import Distribution
from fusetune.analyze.sensor_noise.sensor_series import SENSORS, Sensor
from fusetune.analyze.sensor_noise.starting_noises import StartingNoise, pooled_inertial_noises


@dataclass(frozen=True)
class FlightShare:
    """What one flight adds.

    Attributes
    ----------
    flight : its name
    at_rest, in_flight : distribution of each axis; empty where there are too few samples
    density_in_flight, density_at_rest : broad-band noise, unit/√Hz; None where that is not known
    limited : whether vibration limits it; None where that is not known
    """

    flight: str
    at_rest: tuple[Distribution, ...]
    in_flight: tuple[Distribution, ...]
    density_in_flight: float | None
    density_at_rest: float | None
    limited: bool | None


@dataclass(frozen=True)
class PooledSensor:
    """One device over several flights.

    Attributes
    ----------
    sensor : which
    device_id : PX4's; 0 where the logs do not tell: then flights of one vehicle count as of one device
    flights : what each adds, in the order in which they were given
    curve : None where no flight has a stretch of standing still
    figures : None likewise
    starting : noise parameters that follow from all of them, for an IMU
    """

    sensor: Sensor
    device_id: int
    flights: tuple[FlightShare, ...]
    curve: AllanCurve | None
    figures: AllanFigures | None
    starting: tuple[StartingNoise, ...]

    def histogram(self, *, at_rest: bool) -> np.ndarray:
        """Counts of all flights and axes in `HISTOGRAM_EDGES`, in standard deviations of each."""
        parts = [one for share in self.flights for one in (share.at_rest if at_rest else share.in_flight)]
        return np.sum([one.histogram for one in parts], axis=0) if parts else np.zeros(0)

    def document(self) -> dict[str, Any]:
        """As a JSON object."""
        return {
            "sensor": self.sensor.name,
            "device_id": self.device_id,
            "flights": [share.flight for share in self.flights],
            "limited_in": [share.flight for share in self.flights if share.limited],
            "allan": self.curve.document() if self.curve else None,
            "figures": self.figures.document() if self.figures else None,
            "starting": [one.document() for one in self.starting],
        }


def pooled_sensors(documents: Sequence[Mapping[str, Any]]) -> tuple[PooledSensor, ...]:
    """Sensors of the flights of one vehicle, each device by itself.

    Parameters
    ----------
    documents : of `SensorNoise.document`, or as read from `sensor_noise.json`, the oldest flight first
    """
    devices: dict[tuple[str, int], list[Mapping[str, Any]]] = {}
    for document in documents:
        for name, one in document["sensors"].items():
            devices.setdefault((name, one["device_id"]), []).append({"document": document, **one})
    return tuple(_pooled(name, device_id, found) for (name, device_id), found in devices.items())


def _pooled(name: str, device_id: int, found: Sequence[Mapping[str, Any]]) -> PooledSensor:
    sensor = next(one for one in SENSORS.values() if one.name == name)
    shares = tuple(_share(one) for one in found)
    curve = pooled_curve(AllanCurve.from_document(one["allan"]) for one in found)
    figures = allan_figures(curve) if curve is not None else None
    starting: tuple[StartingNoise, ...] = ()
    if sensor.is_inertial and figures is not None:
        seen = [share.density_in_flight for share in shares if share.density_in_flight is not None]
        newest = found[-1]["document"]
        flown = {one["parameter"]: one["flown"] for one in newest["starting"]}
        starting = pooled_inertial_noises(sensor.name, figures, seen, flown, newest["period_s"])
    return PooledSensor(sensor, device_id, shares, curve, figures, starting)


def _share(one: Mapping[str, Any]) -> FlightShare:
    vibration = one["vibration"] or {}
    return FlightShare(
        flight=one["document"]["flight"],
        at_rest=tuple(Distribution.from_document(axis) for axis in one["at_rest"]),
        in_flight=tuple(Distribution.from_document(axis) for axis in one["in_flight"]),
        density_in_flight=vibration.get("density_in_flight"),
        density_at_rest=vibration.get("density_at_rest"),
        limited=vibration.get("limited"),
    )
