"""Signs of a sound flight, of which a test makes some others; nothing is replayed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fusetune.analyze.diagnosis.airspeed_signs import AirspeedSigns
from fusetune.analyze.diagnosis.barometer_signs import BarometerSigns
from fusetune.analyze.diagnosis.beam_signs import RangeSigns
from fusetune.analyze.diagnosis.field_fits import FieldFit
from fusetune.analyze.diagnosis.flow_signs import FlowSigns
from fusetune.analyze.diagnosis.gnss_motion import GnssMotion
from fusetune.analyze.diagnosis.gnss_signs import GnssSigns
from fusetune.analyze.diagnosis.height_errors import AXES, Effect, HeightErrors
from fusetune.analyze.diagnosis.imu_signs import GyroBias, ImuSigns
from fusetune.analyze.diagnosis.lagged_regression import LaggedFit
from fusetune.analyze.diagnosis.magnetometer_signs import MagnetometerSigns
from fusetune.analyze.diagnosis.motion import Motion
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.diagnosis.vision_signs import VisionSigns
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.px4.flight import Flight
from fusetune.px4.parameters.complete_sets import complete

AIR = ((10_000_000, 70_000_000),)
FIELD, LEVEL = 0.48, 0.21

IMU = ImuSigns(250.0, 2.0, 0.05, np.nan, 0, 0.0, None, (), 0.0, 0.0, 9.81)
BIAS = GyroBias(np.radians([0.3, -0.2, 0.1]), np.arange(3.0), np.zeros((3, 3)), np.radians([0.1, 0.1, 0.2]))
GNSS = GnssSigns(
    300,
    True,
    (),
    {"eph": 0.9, "epv": 1.4, "s_variance_m_s": 0.2},
    {"eph": 0.8, "epv": 1.2, "s_variance_m_s": 0.16},
    {"eph": 3.0, "epv": 5.0, "s_variance_m_s": 0.5},
    None,
    16.0,
    17.0,
    12.0,
    11.0,
    92.0,
    90.0,
    None,
    False,
    (),
    0.05,
)
FIT = LaggedFit(0.112, 0.005, np.zeros(8), np.full(8, 0.01), 300, 12, 0.1)
GNSS_MOTION = GnssMotion(FIT, np.array([0.02, -0.01, -0.03]), np.array([0.02, 0.02, 0.04]), 0.3, 0.005, 0.02, 0.01)


def fits(as_told: float = 0.01, **left: float) -> dict[str, FieldFit]:
    """Fits that leave as much; those that are not named as the readings do as they are told."""
    values = {
        "as_told": {},
        "body_field": {f"body_field_{axis}": 0.01 for axis in "xyz"},
        "motor_field": {f"{name}_{axis}": 0.01 for name in ("body_field", "motor_field") for axis in "xyz"},
        "scale": {f"scale_{axis}": 1.0 for axis in "xyz"},
        "one_scale": {f"scale_{axis}": 1.0 for axis in "xyz"},
        "mounting": {},
    }
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return {
        name: FieldFit(
            left.get(name, 0.3 if name == "mounting" else as_told), one, turn if name == "mounting" else None
        )
        for name, one in values.items()
    }


def with_values(found: dict[str, FieldFit], name: str, **values: float) -> dict[str, FieldFit]:
    """The same with other values of one fit."""
    return found | {name: replace(found[name], values={**found[name].values, **values})}


MAGNETOMETER = MagnetometerSigns(
    1.0,
    FIELD,
    LEVEL,
    True,
    fits(),
    0.001,
    0.005,
    np.full(3, 0.005),
    np.full(3, 0.008),
    None,
    0.0,
    0.01,
    np.radians(3.0),
)
NOTHING = Effect(0.0, 0.2, 0.0)
ERRORS = HeightErrors(NOTHING, dict.fromkeys(AXES, NOTHING), NOTHING, Effect(0.0, 0.01, 0.0), 600, 12)
BAROMETER = BarometerSigns(ERRORS, 0.18, 1.2, 0.4, 1.0, AIR[0])
RANGE = RangeSigns(1000, (), 0.0, 0.0, None, 0.0, 0.03)
FLOW = FlowSigns(replace(FIT, delay_s=0.022), 0.99, 0.02, 0.01, 0.03, np.zeros(2), np.full(2, 0.03))
VISION = VisionSigns(replace(FIT, delay_s=0.03), 1.0, 0.005, 0.01, 0.01, True, 0.02, 0.05, 3.0, 0.1, 0.1)
AIRSPEED = AirspeedSigns(1.02, 0.02, np.zeros(2), 200)


def signs(told: dict[str, float] | None = None, **others: Any) -> Signs:
    """Signs of a sound flight but for some.

    Parameters
    ----------
    told : parameters that differ from their defaults
    others : signs, by their names in `Signs`
    """
    flight = Flight("made", last_timestamp=80_000_000)
    observed = ObservedFlight(flight)
    observed.__dict__.update({"flight": flight, "airborne": AIR})
    made = Signs(observed)
    sound = {
        "is_replayed": False,
        "parameters": complete({}, {"EKF2_OF_DELAY": 20, "EKF2_EV_DELAY": 30, **(told or {})}),
        "imu": IMU,
        "gyro_bias": BIAS,
        "gnss": GNSS,
        "gnss_motion": GNSS_MOTION,
        "magnetometer": MAGNETOMETER,
        "mounting": None,
        "barometer": BAROMETER,
        "range": RANGE,
        "flow": FLOW,
        "vision": VISION,
        "airspeed": AIRSPEED,
        "ratios": {},
        "claims": {},
        "at_limits": (),
        "stuck": {},
        "switches": np.zeros(0, np.int64),
        "motion": _STILL,
        "gnss_sound": AIR,
    }
    made.__dict__.update(sound | others)
    return made


_STILL = Motion(
    np.arange(10_000_000, 14_000_000, 10_000),
    np.tile(np.eye(3), (400, 1, 1)),
    np.full(400, 0.3),
    *[np.zeros((400, 3))] * 4,
    np.zeros(400),
    np.ones(400),
    "made",
)
