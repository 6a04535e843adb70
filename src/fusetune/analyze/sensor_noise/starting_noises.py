"""Noise parameters of EKF2 that follow from the sensors: what they are at rest, and what the flight asks for.

What PX4 means by each (v1.16, `EKF/covariance.cpp` and `EKF/ekf_helper.cpp`, as `ekf2.filter.prediction` mirrors them):

* ``EKF2_GYR_NOISE``, ``EKF2_ACC_NOISE``: per update of Δt the attitude gets (p Δt)², and the velocity likewise. White
  noise of density N adds N² Δt, so p = N / √Δt: the standard deviation of a mean over one update, not a density.
* ``EKF2_GYR_B_NOISE``, ``EKF2_ACC_B_NOISE``: per update the bias gets (p Δt)². A random walk of density K adds K² Δt,
  so p = K / √Δt.
* ``EKF2_MAG_NOISE``, ``EKF2_BARO_NOISE``: standard deviation of one sample.
* ``EKF2_GPS_V_NOISE``, ``EKF2_GPS_P_NOISE``: standard deviation of one sample, but not less than the receiver reports.

Δt is ``EKF2_PREDICT_US``, 10 ms by default.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusetune.analyze.sensor_noise.allan_fit import AllanFigures, NoiseFigure
from fusetune.analyze.sensor_noise.sensor_character import SensorCharacter
from fusetune.analyze.sensor_noise.sensor_series import SensorName
from fusetune.px4.flight import Flight
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS

PERIOD = "EKF2_PREDICT_US"
WHITE: Mapping[SensorName, str] = {"gyro": "EKF2_GYR_NOISE", "accel": "EKF2_ACC_NOISE"}
WALK: Mapping[SensorName, str] = {"gyro": "EKF2_GYR_B_NOISE", "accel": "EKF2_ACC_B_NOISE"}
SAMPLE: Mapping[SensorName, str] = {
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
MORE_IN_FLIGHT = 1.2
TOO_LITTLE = 1.2
"""Noise above what PX4 is told by more than flights of one vehicle differ."""
MORE = (
    "Scale errors, wrong delays and what else the filter's model leaves out usually ask for more than the sensor's "
    "noise: go lower only with sets that are compared on flights"
)
_OF_SAMPLES: Mapping[SensorName, str] = {
    "mag": "At rest slow wandering counts, in flight what changes from sample to sample: currents of the motors and "
    "errors of the calibration come on top.",
    "baro": "At rest slow wandering counts, in flight what changes from sample to sample: the airflow about the "
    "vehicle adds errors of a metre or so, which no spectrum of the sensor tells.",
    "gnss_vel": "At rest the whole velocity counts, in flight what changes from sample to sample, the vehicle's motion "
    "among it.",
    "gnss_pos": "A receiver's error wanders for minutes, of which a short stand shows little.",
}


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
    least : the larger of the two; None where neither is known
    flown : what the vehicle flew with
    start_with : `least` where the vehicle flew with clearly less, else what flew; within PX4's limits
    words : what to make of it
    """

    parameter: str
    unit: str
    at_rest: float | None
    low: float | None
    high: float | None
    in_flight: float | None
    least: float | None
    flown: float
    start_with: float
    words: str

    def document(self) -> dict[str, Any]:
        """As a JSON object."""
        return dict(vars(self))


def starting_noises(
    flight: Flight, characters: Mapping[SensorName, SensorCharacter], flown: Mapping[str, float]
) -> tuple[StartingNoise, ...]:
    """The parameters of the sensors that the flight has.

    Parameters
    ----------
    flight : canonical
    characters : its sensors
    flown : EKF2's parameters
    """
    found = []
    for name, character in characters.items():
        if name in WHITE:
            seen = character.vibration.density_in_flight if character.vibration else None
            found.append(_of_white(name, character.figures.noise_density, seen, flown, period_s(flown)))
            found.append(_of_walk(name, character.figures.random_walk, flown, period_s(flown)))
        elif name in SAMPLE:
            found.append(_of_sample(SAMPLE[name], name, character, flown, flight))
    return tuple(found)


def per_update(density: float, update_s: float) -> float:
    """EKF2's parameter for a density of white noise or of a random walk: over the root of the update's time."""
    return density / math.sqrt(update_s)


def pooled_inertial_noises(
    name: SensorName, figures: AllanFigures, seen: Sequence[float], flown: Mapping[str, float], update_s: float
) -> tuple[StartingNoise, ...]:
    """The two parameters of a gyro or accelerometer over several flights.

    Parameters
    ----------
    name : gyro or accel
    figures : of the Allan curves of all flights together
    seen : broad-band noise in each flight that tells it, unit/√Hz; the median counts
    flown : what the newest flight flew with
    update_s : time of EKF2's updates, s
    """
    usual = float(np.median(seen)) if len(seen) else None
    white = _of_white(name, figures.noise_density, usual, flown, update_s)
    return white, _of_walk(name, figures.random_walk, flown, update_s)


def period_s(flown: Mapping[str, float]) -> float:
    """Time of EKF2's updates, s."""
    return float(flown[PERIOD]) * 1e-6


def _of_white(
    name: SensorName, figure: NoiseFigure, seen: float | None, flown: Mapping[str, float], update_s: float
) -> StartingNoise:
    rest = _Interval.of(figure, update_s)
    flight = None if seen is None else per_update(seen, update_s)
    if flight is None:
        words = "What the flight asks for is not known: the log has too little of it in one piece, or loses samples."
    elif rest.value is None:
        words = f"How much of the noise in flight is the sensor's own is not known: {figure.refusal}."
    elif flight > MORE_IN_FLIGHT * rest.value:
        words = f"In flight the noise is {flight / rest.value:.1f} times that at rest, by vibration."
    else:
        words = "In flight the noise is that at rest."
    return _noise(WHITE[name], rest, flight, flown, words)


def _of_walk(name: SensorName, figure: NoiseFigure, flown: Mapping[str, float], update_s: float) -> StartingNoise:
    words = "In flight temperature and vibration move the bias, too; how much, only the filter's own bias states show."
    if figure.value is None:
        words = f"Not known: {figure.refusal}. {words}"
    return _noise(WALK[name], _Interval.of(figure, update_s), None, flown, words)


def _of_sample(
    parameter: str, name: SensorName, character: SensorCharacter, flown: Mapping[str, float], flight: Flight
) -> StartingNoise:
    axes = character.in_flight[:HORIZONTAL] if name in REPORTED else character.in_flight
    moving = float(np.sqrt(np.mean([one.spread**2 for one in axes]))) if axes else None
    words = _OF_SAMPLES[name]
    if character.wander is None:
        words = f"The vehicle does not stand still in this log. {words}"
    reported = _reported(flight, REPORTED[name]) if name in REPORTED else None
    if reported is not None:
        words += f" The receiver itself reports {reported:.2g}: below that the parameter changes nothing."
    return _noise(parameter, _Interval(character.wander), moving, flown, words)


def _reported(flight: Flight, field: str) -> float | None:
    table = flight.topic("vehicle_gps_position")
    if table is None or field not in table:
        return None
    values = np.asarray(table[field], np.float64)
    values = values[np.isfinite(values) & (values > 0.0)]
    return float(np.median(values)) if len(values) else None


@dataclass(frozen=True)
class _Interval:
    value: float | None
    low: float | None = None
    high: float | None = None

    @classmethod
    def of(cls, figure: NoiseFigure, update_s: float) -> _Interval:
        """A density as EKF2's parameter."""
        value, low, high = (
            None if one is None else per_update(one, update_s) for one in (figure.value, figure.low, figure.high)
        )
        return cls(value, low if high is not None else None, high)


def _noise(
    parameter: str, rest: _Interval, in_flight: float | None, flown: Mapping[str, float], words: str
) -> StartingNoise:
    metadata, present = ALL_PARAMETERS[parameter], float(flown[parameter])
    least = max((one for one in (rest.value, in_flight) if one is not None), default=None)
    start = present
    if least is not None and least > TOO_LITTLE * present:
        start = float(f"{min(least, metadata.maximum or math.inf):.{_DIGITS}g}")
        words += f" PX4 is told {present:.2g}, less than the noise that is there: begin with {start:g}."
        if metadata.maximum is not None and least > metadata.maximum:
            words += f" PX4 allows no more than {metadata.maximum:g}."
    elif least == 0.0:
        words += " Its readings hold one value and tell no noise."
    elif least is not None:
        words += f" PX4 is told {present:.2g}, {present / least:.1f} times the noise that is there. {MORE}."
    return StartingNoise(
        parameter, metadata.unit, rest.value, rest.low, rest.high, in_flight, least, present, start, words
    )
