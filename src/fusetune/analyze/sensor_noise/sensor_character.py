"""Everything that is measured of one sensor of one flight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.flight.throttle import Throttle
from fusetune.analyze.sensor_noise.allan import AllanCurve, allan_curve
from fusetune.analyze.sensor_noise.allan_fit import AllanFigures, allan_figures
from fusetune.analyze.sensor_noise.distribution import Distribution, distributions
from fusetune.analyze.sensor_noise.sensor_series import Sensor, SensorSeries
from fusetune.analyze.sensor_noise.spectrum import Spectrum, spectrum
from fusetune.analyze.sensor_noise.standing_still import SHORTEST_S
from fusetune.analyze.sensor_noise.vibration import Vibration, vibration
from fusetune.save.checks.standstill import Standstill, standstill

STUCK_S = {"gyro": 0.1, "accel": 0.1, "mag": 2.0, "baro": 2.0, "gnss_vel": 5.0, "gnss_pos": 5.0}
"""One value held for longer is told as stuck; shorter, it may be the sensor's steps."""


@dataclass(frozen=True)
class SensorCharacter:
    """One sensor of one flight.

    Attributes
    ----------
    series : its samples
    still_s : how long it stood still, s
    curve : Allan variance of all stretches and axes together
    figures : what it says of the sensor, its axes together
    axis_figures : of each axis
    at_rest, in_flight : distribution of each axis; empty where there are too few samples
    wander : root of the mean square deviation from the mean of each stretch, axes together (of GNSS the horizontal
        ones, of its velocity from zero); None without a stretch
    rest_spectrum, flight_spectrum : of inertial sensors and magnetometers; None where there are too few samples
    vibration : None of other sensors
    stuck : the longest time that one value was held
    """

    series: SensorSeries
    still_s: float
    curve: AllanCurve
    figures: AllanFigures
    axis_figures: tuple[AllanFigures, ...]
    at_rest: tuple[Distribution, ...]
    in_flight: tuple[Distribution, ...]
    wander: float | None
    rest_spectrum: Spectrum | None
    flight_spectrum: Spectrum | None
    vibration: Vibration | None
    stuck: Standstill

    @property
    def sensor(self) -> Sensor:
        """Which."""
        return self.series.sensor

    def document(self) -> dict[str, Any]:
        """As a JSON object, without the samples."""
        return {
            "sensor": self.sensor.name,
            "topic": self.series.topic,
            "unit": self.sensor.unit,
            "rate_hz": self.series.rate_hz,
            "device_id": self.series.device_id,
            "still_s": self.still_s,
            "allan": self.curve.document(),
            "figures": self.figures.document(),
            "axis_figures": dict(zip(self.sensor.axes, (one.document() for one in self.axis_figures), strict=True)),
            "at_rest": [one.document() for one in self.at_rest],
            "in_flight": [one.document() for one in self.in_flight],
            "wander": self.wander,
            "vibration": self.vibration.document() if self.vibration else None,
            "longest_stuck_s": self.stuck.longest_s,
            "stuck_share": self.stuck.share,
        }


def sensor_character(
    series: SensorSeries, still: Sequence[Interval], airborne: Sequence[Interval], command: Throttle | None
) -> SensorCharacter:
    """Measure one sensor.

    Parameters
    ----------
    series : its samples
    still, airborne : when the vehicle stood still, and when it flew, µs
    command : of the motors; None where the log has none
    """
    pieces = series.pieces(still, SHORTEST_S)
    scaled = [one * series.shorter_mean for one in pieces]
    curve = allan_curve(scaled, series.step_s)
    axes = range(series.values.shape[1])
    by_axis = tuple(allan_figures(allan_curve([one[:, i] for one in scaled], series.step_s)) for i in axes)
    has_spectrum = series.sensor.is_inertial or series.sensor.name == "mag"
    rest = spectrum(series, still) if has_spectrum else None
    flight = spectrum(series, airborne) if has_spectrum else None
    return SensorCharacter(
        series=series,
        still_s=sum(len(one) for one in pieces) * series.step_s,
        curve=curve,
        figures=allan_figures(curve),
        axis_figures=by_axis,
        at_rest=distributions(series, still),
        in_flight=distributions(series, airborne),
        wander=_wander(series, pieces),
        rest_spectrum=rest,
        flight_spectrum=flight,
        vibration=vibration(series, rest, flight, airborne, command) if has_spectrum else None,
        stuck=_stuck(series, airborne),
    )


def _wander(series: SensorSeries, pieces: list[np.ndarray]) -> float | None:
    if not pieces:
        return None
    name = series.sensor.name
    used = [one[:, :2] if name.startswith("gnss") else one for one in pieces]
    centred = used if name == "gnss_vel" else [one - one.mean(axis=0) for one in used]
    return float(np.sqrt(np.mean(np.concatenate(centred) ** 2)))


def _stuck(series: SensorSeries, airborne: Sequence[Interval]) -> Standstill:
    """All axes at one value; in the air where the vehicle flew: on the ground a simulated sensor may have no noise."""
    table = {"timestamp": series.time} | {str(i): series.values[:, i] for i in range(series.values.shape[1])}
    middle = series.inside(airborne)
    counted = middle[1:] & middle[:-1] if middle.any() else np.ones(len(series.time) - 1, np.bool_)
    columns = [str(i) for i in range(series.values.shape[1])]
    return standstill(table, columns, STUCK_S[series.sensor.name], counted)
