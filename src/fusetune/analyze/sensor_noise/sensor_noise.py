"""The sensors of a flight: how noisy at rest, what vibration makes of it, and the parameters to begin with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.flight.throttle import SOURCES, throttle
from fusetune.analyze.flight_files import SENSOR_NOISE_FILE
from fusetune.analyze.sensor_noise.sensor_character import SensorCharacter, sensor_character
from fusetune.analyze.sensor_noise.sensor_series import SensorName, sensor_series
from fusetune.analyze.sensor_noise.standing_still import standing_still
from fusetune.analyze.sensor_noise.starting_noises import StartingNoise, period_s, starting_noises
from fusetune.px4.flight import Flight
from fusetune.px4.flown_parameters import flown_parameters
from fusetune.px4.layouts.release_layouts import ESTIMATOR_TOPICS, canonical
from fusetune.save.flight_folder import load_flight
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path

SENSOR_NOISE_TOPICS = frozenset(
    {
        *ESTIMATOR_TOPICS,
        "vehicle_imu",
        *(f"sensor_{one}{kind}" for one in ("gyro", "accel") for kind in ("", "_fifo")),
        *SOURCES,
    }
)
"""What is read of a saved flight, of any release."""


@dataclass(frozen=True)
class SensorNoise:
    """The sensors of one flight.

    Attributes
    ----------
    flight : its name
    start_timestamp : of its log, µs since boot
    still, airborne : when the vehicle stood still, and when it flew, µs
    sensors : those that it has
    starting : noise parameters that follow
    period_s : time of EKF2's updates, s
    """

    flight: str
    start_timestamp: int
    still: tuple[Interval, ...]
    airborne: tuple[Interval, ...]
    sensors: dict[SensorName, SensorCharacter]
    starting: tuple[StartingNoise, ...]
    period_s: float

    @property
    def vibration_limited(self) -> tuple[SensorName, ...]:
        """Sensors whose noise in flight vibration makes."""
        return tuple(name for name, one in self.sensors.items() if one.vibration and one.vibration.limited)

    def document(self) -> dict[str, Any]:
        """As a JSON object, without the samples."""
        return {
            "flight": self.flight,
            "still_s": [self._seconds(one) for one in self.still],
            "airborne_s": [self._seconds(one) for one in self.airborne],
            "vibration_limited": list(self.vibration_limited),
            "sensors": {name: one.document() for name, one in self.sensors.items()},
            "period_s": self.period_s,
            "starting": [one.document() for one in self.starting],
        }

    def _seconds(self, interval: Interval) -> list[float]:
        return [round((one - self.start_timestamp) * 1e-6, 3) for one in interval]


def sensor_noise(flight: Flight, airborne: Sequence[Interval]) -> SensorNoise:
    """Characterise the sensors of a flight.

    Parameters
    ----------
    flight : canonical
    airborne : when it was in the air, µs; empty where that is not known: then nothing is said of the flight, and the
        log is searched for times of standing still by the IMU alone
    """
    series = sensor_series(flight)
    still: tuple[Interval, ...] = ()
    if "gyro" in series and "accel" in series:
        still = standing_still(flight, series["gyro"], series["accel"], airborne)
    command = throttle(flight)
    found = {name: sensor_character(one, still, airborne, command) for name, one in series.items()}
    flown = flown_parameters(flight)
    starting = starting_noises(flight, found, flown)
    return SensorNoise(flight.name, flight.start_timestamp, still, tuple(airborne), found, starting, period_s(flown))


def sensor_noise_of(flight_folder: AnyPath) -> SensorNoise:
    """Characterise the sensors of a saved flight.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`

    Raises
    ------
    UserError
        The folder is not one of a saved flight, or a file in it is damaged.
    """
    flight = canonical(load_flight(flight_folder, topics=SENSOR_NOISE_TOPICS))
    return sensor_noise(flight, airborne_intervals(flight, {}))


def write_sensor_noise(flight_folder: AnyPath, output_folder: AnyPath) -> SensorNoise:
    """Characterise the sensors of a saved flight and write `sensor_noise.json`.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    output_folder : `results/analyze/<flight>`, which must exist

    Raises
    ------
    UserError
        The folder is not one of a saved flight, or a file in it is damaged.
    """
    found = sensor_noise_of(flight_folder)
    with atomic_path(Path(output_folder) / SENSOR_NOISE_FILE) as temporary:
        write_document(temporary, found.document())
    return found
