"""Whether a sensor is limited by vibration in flight, or by its own noise; and what may be folded into its log."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.flight.throttle import Throttle
from fusetune.analyze.sensor_noise.motor_harmonics import MOST_HARMONIC, MotorTones, motor_tones, shown_at
from fusetune.analyze.sensor_noise.sensor_series import SensorSeries
from fusetune.analyze.sensor_noise.spectrum import Spectrum, tones

LIMITED = 2.0
"""In flight so many times the broad-band noise at rest: vibration, not the sensor, then makes three quarters of it."""


@dataclass(frozen=True)
class Vibration:
    """A sensor in flight against the same at rest.

    Attributes
    ----------
    density_in_flight, density_at_rest : broad-band noise, mean of the axes, unit/√Hz by the two-sided density, as
        Allan's N; None where there are too few samples
    limited : whether vibration limits it; None where one of the two is not known
    tones : that stand out in flight
    aliasing : what may be folded into the log, in words; empty where nothing speaks for it
    """

    density_in_flight: float | None
    density_at_rest: float | None
    limited: bool | None
    tones: MotorTones
    aliasing: str

    @property
    def ratio(self) -> float | None:
        """In flight over at rest; None where one of the two is not known."""
        if self.density_in_flight is None or not self.density_at_rest:
            return None
        return self.density_in_flight / self.density_at_rest

    def document(self) -> dict[str, Any]:
        """As a JSON object."""
        return {
            "density_in_flight": self.density_in_flight,
            "density_at_rest": self.density_at_rest,
            "ratio": self.ratio,
            "limited": self.limited,
            "fundamental_hz": self.tones.fundamental_hz,
            "throttle": self.tones.throttle,
            "tones": [one.document() for one in self.tones.listed],
            "aliasing": self.aliasing,
        }


def vibration(
    series: SensorSeries,
    at_rest: Spectrum | None,
    in_flight: Spectrum | None,
    airborne: Sequence[Interval],
    command: Throttle | None,
) -> Vibration:
    """Compare a sensor's spectra.

    Parameters
    ----------
    series : of the sensor
    at_rest, in_flight : None where there are too few samples
    airborne : µs
    command : of the motors; None where the log has none
    """
    rest, flight = _density(series, at_rest), _density(series, in_flight)
    limited = None if rest is None or flight is None else flight >= LIMITED * rest
    found = motor_tones(series, airborne, tones(in_flight) if in_flight is not None else (), command)
    return Vibration(flight, rest, limited, found, _aliasing(series, found))


def _density(series: SensorSeries, found: Spectrum | None) -> float | None:
    return None if found is None else math.sqrt(0.5 * found.broadband()) * series.shorter_mean


def _aliasing(series: SensorSeries, found: MotorTones) -> str:
    """Why tones may show where they are not: one goes against the throttle, or multiples lie above half the rate."""
    rate = series.rate_hz
    against = [one for one in found.listed if one.slope_hz is not None and one.slope_hz < 0.0]
    if against:
        seen = against[0].tone.frequency_hz
        return (
            f"the tone at {seen:.0f} Hz goes down as the throttle goes up: it is one of {rate - seen:.0f} Hz or more, "
            f"folded by the rate of {rate:.0f} Hz"
        )
    if found.fundamental_hz is None:
        return ""
    above = [n for n in range(2, MOST_HARMONIC + 1) if n * found.fundamental_hz > 0.5 * rate]
    if not above:
        return ""
    places = ", ".join(
        f"{n * found.fundamental_hz:.0f} Hz at {shown_at(n * found.fundamental_hz, rate):.0f}" for n in above
    )
    half = 0.5 * rate
    return (
        f"multiples of {found.fundamental_hz:.0f} Hz above {half:.0f} Hz, half of the rate, show elsewhere: {places} Hz"
    )
