"""Noise parameters of EKF2 that follow from the sensors: what they are at rest, and what the flight asks for.

What PX4 means by each (v1.16, `EKF/covariance.cpp` and `EKF/ekf_helper.cpp`, as `ekf2.filter.prediction` mirrors them):

* ``EKF2_GYR_NOISE``, ``EKF2_ACC_NOISE``: per update of Δt the attitude gets (p Δt)² and the velocity likewise. White noise of
  density N adds N² Δt, so p = N / √Δt: the standard deviation of a mean over one update, not a density.
* ``EKF2_GYR_B_NOISE``, ``EKF2_ACC_B_NOISE``: per update the bias gets (p Δt)². A random walk of density K adds K² Δt, so
  p = K / √Δt.
* ``EKF2_MAG_NOISE``, ``EKF2_BARO_NOISE``: standard deviation of one sample.
* ``EKF2_GPS_V_NOISE``, ``EKF2_GPS_P_NOISE``: standard deviation of one sample, but not less than the receiver reports for it.

Δt is ``EKF2_PREDICT_US``, 10 ms by default.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.sensor_noise.sensor_character import SensorCharacter
from fusetune.analyze.sensor_noise.sensor_series import SensorName
from fusetune.px4.flight import Flight
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS, complete

PERIOD = "EKF2_PREDICT_US"
WHITE = {"gyro": "EKF2_GYR_NOISE", "accel": "EKF2_ACC_NOISE"}
WALK = {"gyro": "EKF2_GYR_B_NOISE", "accel": "EKF2_ACC_B_NOISE"}
SAMPLE = {
    "mag": "EKF2_MAG_NOISE",
    "baro": "EKF2_BARO_NOISE",
    "gnss_vel": "EKF2_GPS_V_NOISE",
    "gnss_pos": "EKF2_GPS_P_NOISE",
}
REPORTED = {"gnss_vel": "s_variance_m_s", "gnss_pos": "eph"}
"""What the receiver says of its own error, one standard deviation; the parameter is a floor below it."""
HORIZONTAL = 2
"""Axes of GNSS that the parameters are about; the vertical ones are worse by a factor that PX4 has built in."""
_DIGITS = 2
MORE = (
    "In flight vibration, scale errors and what the filter's model leaves out usually ask for more than the sensor at rest: "
    "take the value at rest for the least that makes sense"
)


@dataclass(frozen=True)
class StartingNoise:
    """A noise parameter with what a flight says of it.

    Attributes
    ----------
    parameter : PX4's name
    unit : of its value
    at_rest : that the sensor standing still would ask for; None where that is not known
    low, high : 95 % interval of it where it has one; without a value `high` is what it is not above
    in_flight : that the noise in flight asks for; None where that is not known
    flown : what the vehicle flew with
    start_with : within PX4's limits; None where nothing is better known than what flew
    words : what to make of it
    """

    parameter: str
    unit: str
    at_rest: float | None
    low: float | None
    high: float | None
    in_flight: float | None
    flown: float
    start_with: float | None
    words: str

    def document(self) -> dict[str, Any]:
        """As a JSON object."""
        return dict(vars(self))


def starting_noises(
    flight: Flight, characters: Mapping[SensorName, SensorCharacter], still: tuple[Interval, ...]
) -> tuple[StartingNoise, ...]:
    """The parameters of the sensors that the flight has.

    Parameters
    ----------
    flight : canonical
    characters : its sensors
    still : when it stood still, µs
    """
    flown = complete(flight.parameters.initial, {}, flight.release)
    found = []
    for name, character in characters.items():
        if name in WHITE:
            found.append(_of_white(WHITE[name], character, flown))
            found.append(_of_walk(WALK[name], character, flown))
        elif name in SAMPLE:
            found.append(_of_sample(SAMPLE[name], name, character, flown, flight, still))
    return tuple(found)


def per_update(density: float, period_s: float) -> float:
    """EKF2's parameter for a density of white noise or of a random walk: over the root of the update's time."""
    return density / math.sqrt(period_s)


def _period_s(flown: Mapping[str, float]) -> float:
    return float(flown[PERIOD]) * 1e-6


def _of_white(parameter: str, character: SensorCharacter, flown: Mapping[str, float]) -> StartingNoise:
    period_s, figure = _period_s(flown), character.figures.noise_density
    rest = None if figure.value is None else per_update(figure.value, period_s)
    seen = character.vibration.density_in_flight if character.vibration else None
    flight = None if seen is None else per_update(seen, period_s)
    start = None if flight is None else max(flight, rest or 0.0)
    if flight is None:
        words = f"the flight is too short, or was not logged, to tell what it asks for. {MORE}."
    elif rest is None:
        words = f"broad-band noise in flight asks for this; what of it is the sensor's own is not known: {figure.refusal}."
    elif flight > rest * 1.2:
        words = f"in flight the noise is {flight / rest:.1f} times that at rest: begin with the value in flight. {MORE}."
    else:
        words = f"in flight the noise is that at rest. {MORE}."
    low, high = (per_update(figure.low, period_s), per_update(figure.high, period_s)) if figure.high else (None, None)
    return _noise(parameter, rest, (low, high), flight, flown, start, words)


def _of_walk(parameter: str, character: SensorCharacter, flown: Mapping[str, float]) -> StartingNoise:
    period_s, figure = _period_s(flown), character.figures.random_walk
    rest = None if figure.value is None else per_update(figure.value, period_s)
    low, high = (per_update(figure.low, period_s), per_update(figure.high, period_s)) if figure.high else (None, None)
    words = "In flight temperature and vibration move the bias, too; how much shows only by the filter's own bias states."
    if rest is None:
        words = f"{figure.refusal}: keep what flew. {words}"
    return _noise(parameter, rest, (low, high), None, flown, rest, words)


def _of_sample(
    parameter: str,
    name: SensorName,
    character: SensorCharacter,
    flown: Mapping[str, float],
    flight: Flight,
    still: tuple[Interval, ...],
) -> StartingNoise:
    rest = character.wander
    axes = character.in_flight[:HORIZONTAL] if name.startswith("gnss") else character.in_flight
    moving = float(np.sqrt(np.mean([one.spread**2 for one in axes]))) if axes else None
    known = [one for one in (rest, moving) if one is not None]
    start = max(known) if known and name in ("mag", "baro") else rest
    words = "At rest the whole deviation from the mean counts, slow wandering too; in flight only what changes from sample to sample."
    if name in REPORTED:
        reported = _reported(flight, REPORTED[name])
        words = "The receiver's error wanders for minutes, so that a short stand shows too little of it: take it for the least."
        if reported is not None:
            words += f" The receiver itself reports {reported:.2g}: below that the parameter changes nothing."
    elif name == "baro":
        words += " In flight the airflow about the vehicle adds errors of a metre or so that no spectrum of the sensor tells."
    elif name == "mag":
        words += " Currents of the motors and errors of the calibration add to it in flight."
    if rest is None and not still:
        words = f"the vehicle does not stand still in this log. {words}"
    return _noise(parameter, rest, (None, None), moving, flown, start, words)


def _reported(flight: Flight, field: str) -> float | None:
    table = flight.topic("vehicle_gps_position")
    if table is None or field not in table:
        return None
    values = np.asarray(table[field], np.float64)
    values = values[np.isfinite(values) & (values > 0.0)]
    return float(np.median(values)) if len(values) else None


def _noise(
    parameter: str,
    rest: float | None,
    limits: tuple[float | None, float | None],
    in_flight: float | None,
    flown: Mapping[str, float],
    start: float | None,
    words: str,
) -> StartingNoise:
    metadata = ALL_PARAMETERS[parameter]
    if start is not None:
        within = min(max(start, metadata.minimum or 0.0), metadata.maximum or math.inf)
        if within != start:
            words += f" PX4 allows {metadata.minimum:g} to {metadata.maximum:g}."
        start = float(f"{within:.{_DIGITS}g}")
    return StartingNoise(parameter, metadata.unit, rest, *limits, in_flight, float(flown[parameter]), start, words)


