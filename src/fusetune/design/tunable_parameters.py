"""The catalogue of EKF2's parameters that are worth tuning: what kind each is, and between which values it makes sense.

The metadata's ranges are those that PX4 takes; the sane ones below lie inside them and keep studies and searches away
from values that only break the filter. What a parameter works through stands in `px4/aid_sources.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from fusetune.px4.aid_sources import SENSORS
from fusetune.px4.parameter_sources import required_sources
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS

Kind = Literal["process noise", "bias noise", "measurement noise", "gate", "delay", "lever arm"]
Scale = Literal["log", "linear"]

ARM_PARAMETERS = {"gnss": ("EKF2_GPS_POS_X", "EKF2_GPS_POS_Y", "EKF2_GPS_POS_Z")}
"""Sensor of velocities → parameters that tell PX4 where it is."""

DELAY_LIMIT, DELAY_SUFFIX = "EKF2_DELAY_MAX", "_DELAY"


@dataclass(frozen=True)
class KindFacts:
    """What parameters of a kind have in common.

    Attributes
    ----------
    scale : "log" where ratios count, "linear" where differences do
    step : by which `around_present` moves it up and down: a ratio, or a difference in its unit
    reach : how far a search may go from the present value on a linear scale, in its unit; on a logarithmic one the
        ratio is the caller's
    grid : values are whole multiples of this; 0 where there is no grid
    why : for people, why it is varied so
    """

    scale: Scale
    step: float
    reach: float
    grid: float
    why: str


KINDS: Mapping[Kind, KindFacts] = {
    "process noise": KindFacts("log", 2.0, math.nan, 0.0, "its square enters: ratios count"),
    "bias noise": KindFacts("log", 3.0, math.nan, 0.0, "little depends on it: a larger step"),
    "measurement noise": KindFacts("log", 2.0, math.nan, 0.0, "its square enters: ratios count"),
    "gate": KindFacts("log", 2.0, math.nan, 0.0, "in standard deviations; below 2 it refuses 5 % of sound samples"),
    "delay": KindFacts("linear", 40.0, 100.0, 10.0, "acts in steps of 10 ms, the filter's updates"),
    "lever arm": KindFacts("linear", 0.2, 0.5, 0.0, "seen only while the vehicle turns"),
}
"""By kind. A step of 2 in a noise is one that replays can tell; 40 ms and 0.2 m are errors that people make."""


@dataclass(frozen=True)
class TunableParameter:
    """A parameter that is worth tuning.

    Attributes
    ----------
    name, kind
    low, high : its sane range, inside the metadata's; of delays `DELAY_LIMIT` bounds it, too
    why : for people, why the range ends there
    """

    name: str
    kind: Kind
    low: float
    high: float
    why: str

    @property
    def facts(self) -> KindFacts:
        """What it has in common with others of its kind."""
        return KINDS[self.kind]

    @property
    def unit(self) -> str:
        """As the metadata spells it."""
        return PARAMETERS[self.name].unit

    @property
    def sources(self) -> tuple[str, ...]:
        """Aid sources of which one must be fused for it to act; empty where it acts without any."""
        return required_sources(self.name)

    def sane_range(self, present: Mapping[str, float]) -> tuple[float, float]:
        """Between which values it makes sense on a vehicle with these parameters.

        PX4 sizes its buffers by the longest of EKF2_DELAY_MAX and all delays (`Ekf::initialise_interface`). A delay
        beyond that would move the fusion time horizon for all sensors, and so compare two things at once.
        """
        if self.kind != "delay":
            return self.low, self.high
        horizon = present.get(DELAY_LIMIT, PARAMETERS[DELAY_LIMIT].default)
        delays = [present[one] for one in _DELAYS if math.isfinite(present.get(one, math.nan))]
        return self.low, min(self.high, max([horizon, *delays]) if math.isfinite(horizon) else self.high)


def reach_ms(delay_ms: float) -> float:
    """EKF2_DELAY_MAX that a delay needs, in steps of 10 ms.

    PX4 keeps samples for EKF2_DELAY_MAX, counted in updates of 10 ms (`Ekf::initialise_interface`); where the IMU's
    rate makes updates shorter, 8 ms at 250 Hz, it acts as that shorter time. A delay needs one update more than itself.
    """
    return _UPDATE_MS * math.ceil((delay_ms + _UPDATE_MS) * _SHORTEST_UPDATES / _UPDATE_MS)


_UPDATE_MS, _SHORTEST_UPDATES = 10.0, 1.25
_DELAYS = tuple(sensor.delay_parameter for sensor in SENSORS.values() if sensor.buffered)

# fmt: off
_ROWS = (
    # the ratio of these to GNSS velocity's noise decides how fast the filter follows: what matters most
    TunableParameter("EKF2_ACC_NOISE", "process noise", 0.02, 1.0, "a MEMS sensor's own noise; PX4's limit"),
    TunableParameter("EKF2_GYR_NOISE", "process noise", 0.001, 0.1, "a MEMS sensor's own noise; PX4's limit"),
    TunableParameter("EKF2_MAG_E_NOISE", "process noise", 1e-5, 0.01, "a constant field; one that follows all"),
    TunableParameter("EKF2_TERR_NOISE", "process noise", 0.5, 20.0, "PX4's limit; a terrain that nothing follows"),
    TunableParameter("EKF2_WIND_NSD", "process noise", 0.005, 0.5, "wind that never changes; gusts taken for wind"),
    TunableParameter("EKF2_ACC_B_NOISE", "bias noise", 1e-4, 0.01, "a bias that never changes; PX4's limit"),
    TunableParameter("EKF2_GYR_B_NOISE", "bias noise", 3e-5, 0.01, "a bias that never changes; PX4's limit"),
    TunableParameter("EKF2_MAG_B_NOISE", "bias noise", 1e-6, 0.005, "a bias that never changes; one that follows all"),
    TunableParameter("EKF2_GPS_V_NOISE", "measurement noise", 0.03, 3.0, "the best receivers; aiding in name only"),
    TunableParameter("EKF2_GPS_P_NOISE", "measurement noise", 0.01, 10.0, "RTK; PX4's limit"),
    TunableParameter("EKF2_BARO_NOISE", "measurement noise", 0.1, 15.0, "the best barometers; PX4's limit"),
    TunableParameter("EKF2_MAG_NOISE", "measurement noise", 0.002, 0.5, "the best sensors; as much as the field"),
    TunableParameter("EKF2_HEAD_NOISE", "measurement noise", 0.02, 1.0, "about 1°; PX4's limit"),
    TunableParameter("EKF2_RNG_NOISE", "measurement noise", 0.01, 2.0, "PX4's limit; worse than a barometer"),
    TunableParameter("EKF2_OF_N_MIN", "measurement noise", 0.05, 0.5, "PX4's limit; the default for the worst quality"),
    TunableParameter("EKF2_OF_N_MAX", "measurement noise", 0.05, 2.0, "PX4's limit; aiding in name only"),
    TunableParameter("EKF2_EVP_NOISE", "measurement noise", 0.01, 2.0, "PX4's limit; worse than GNSS"),
    TunableParameter("EKF2_EVV_NOISE", "measurement noise", 0.01, 2.0, "PX4's limit; worse than GNSS"),
    TunableParameter("EKF2_EVA_NOISE", "measurement noise", 0.05, 1.0, "PX4's limit; worse than a compass"),
    TunableParameter("EKF2_EAS_NOISE", "measurement noise", 0.5, 5.0, "PX4's limits"),
    TunableParameter("EKF2_BETA_NOISE", "measurement noise", 0.1, 1.0, "PX4's limits"),
    TunableParameter("EKF2_DRAG_NOISE", "measurement noise", 0.5, 10.0, "PX4's limits"),
    TunableParameter("EKF2_GRAV_NOISE", "measurement noise", 0.1, 10.0, "PX4's limits"),
    *(
        TunableParameter(name, "gate", 2.0, 20.0, "refuses 5 % of sound samples; refuses nothing")
        for name in (
            "EKF2_GPS_V_GATE", "EKF2_GPS_P_GATE", "EKF2_BARO_GATE", "EKF2_MAG_GATE", "EKF2_HDG_GATE", "EKF2_RNG_GATE",
            "EKF2_OF_GATE", "EKF2_EVP_GATE", "EKF2_EVV_GATE", "EKF2_TAS_GATE", "EKF2_BETA_GATE",
        )
    ),
    *(
        TunableParameter(name, "delay", 0.0, 300.0, "measured in the past; PX4's limit and EKF2_DELAY_MAX")
        for name in _DELAYS
    ),
    *(
        TunableParameter(f"EKF2_{sensor}_POS_{axis}", "lever arm", -1.0, 1.0, "a vehicle that one person carries")
        for sensor in ("GPS", "RNG", "OF", "EV") for axis in "XYZ"
    ),
)
# fmt: on

TUNABLE_PARAMETERS: Mapping[str, TunableParameter] = {row.name: row for row in _ROWS}
"""By name, in the order in which studies vary them. EKF2_IMU_POS_* is not among them: to move the IMU is to move all
other sensors, which are. Switches, checks and limits are decisions of the pilot, not figures to tune."""

_SELDOM_SEEN = frozenset({
    "EKF2_MAG_E_NOISE", "EKF2_MAG_B_NOISE", "EKF2_TERR_NOISE", "EKF2_WIND_NSD", "EKF2_HEAD_NOISE", "EKF2_OF_N_MAX",
    "EKF2_BETA_NOISE", "EKF2_DRAG_NOISE", "EKF2_GRAV_NOISE",
})  # fmt: skip


def _is_usual(one: TunableParameter) -> bool:
    if one.kind == "gate":
        return one.name == "EKF2_GPS_V_GATE"
    if one.kind == "lever arm":
        return one.name.startswith("EKF2_GPS_")
    return one.name not in _SELDOM_SEEN


USUALLY_VARIED = tuple(one.name for one in TUNABLE_PARAMETERS.values() if _is_usual(one))
"""Those that a study around the present values varies where it names none: the others are seldom seen in the evidence,
and each set more makes it harder for the others to stand out from chance."""
