"""The one table of sensors and aid sources of EKF2: what a fact of them is, is said here and derived elsewhere.

Sensors are what messages come from, aid sources what the estimator makes of their samples, named as in the topics
`estimator_aid_src_<name>`. Names, parameters and flags are those of PX4 v1.16 where nothing else is said. Adding a row
is told in CONTRIBUTING ("An aid source"); imports nothing, so that reading a configuration stays cheap.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

Release = tuple[int, int]

AXES = ("x", "y", "z")
"""Names of the axes 0, 1, 2 of a source; their meaning (NED, body, …) is that of the source."""


class Limit(NamedTuple):
    """Between what a field can lie at all; beyond it a message is damaged."""

    low: float
    high: float
    may_be_nan: bool = False


@dataclass(frozen=True)
class SensorTopic:
    """A topic that feeds the estimator, in v1.16's layout.

    Attributes
    ----------
    needed : fields without which it says nothing, or which every release has
    limits : by field
    since : first release whose estimator reads it
    made_of : topics that it is made of in logs of other releases
    stamped_by_sample : whether EKF2 takes its `timestamp_sample`, not its `timestamp`
    relative_field : field of `ekf2_timestamps` that names its messages
    """

    name: str
    needed: tuple[str, ...] = ()
    limits: Mapping[str, Limit] = field(default_factory=dict)
    since: Release = (1, 8)
    made_of: tuple[str, ...] = ()
    stamped_by_sample: bool = False
    relative_field: str = ""


@dataclass(frozen=True)
class Sensor:
    """A sensor as the estimator's inputs name it.

    Attributes
    ----------
    label : for people
    topics : that its samples are taken from, the preferred one first
    delay_parameter : by which the estimator shifts the time of a measurement, ms
    buffered : whether the estimator's interface keeps its samples until the horizon passes them, and the replay does
    """

    name: str
    label: str
    delay_parameter: str
    topics: tuple[SensorTopic, ...]
    buffered: bool = True


class Switch(NamedTuple):
    """The parameter that switches a source: by bits of which one must be set or, without any, by another value."""

    parameter: str
    bits: int = 0
    off: float = 0.0

    def is_on(self, value: float) -> bool:
        """Whether a value of the parameter lets the source be fused."""
        return bool(int(value) & self.bits) if self.bits else value != self.off


class NoiseFloor(NamedTuple):
    """A noise parameter that is a floor: it acts where the receiver reports less than `factor` times its value."""

    parameter: str
    field: str
    factor: float


@dataclass(frozen=True)
class AidSource:
    """One aid source as PX4 names it.

    Attributes
    ----------
    label, unit : for people, of the innovations
    quantity : what it tells of, in a word; `"velocity"`, `"position"`, `"height"` and `"heading"` are NED
    groups : name of an aggregate and the axes that it joins, e.g. `("horizontal", (0, 1))`
    code : by which the replay's tables name it; None where the estimator of v1.16 has no such source
    sensor : a key of `SENSORS`; empty where it is made of IMU data and assumptions alone
    part : of its sensor's samples, where each may hold or lack it, by the name of the source that stands for it
    switch : what switches it on; None where nothing does
    gate_parameter : the gate, in standard deviations (test ratio = ν² / (gate² S)); None where it is a constant
    noise_parameters : that go into its observation variance, and into little else
    noise_floors : noise parameters that are floors below what the receiver reports
    acts : how the names of the parameters begin that act only through it (the longest of all rows counts)
    flags : control flags `cs_*` of which one is set while it is fused; empty where none tells
    measures : whether it measures something, and is not invented to bound the filter
    every_update : whether it is made of the IMU at every update, so that being fused says nothing
    stops_drift : whether it bounds the horizontal drift
    withheld : whether the estimator can go on without its sensor and predict it
    innovations : fields of `estimator_innovations` and its like (v1.11 on), by axis
    ekf2_innovations : fields of that topic (before v1.11)
    size_figure : under which the size of its innovations is compared with the vehicle's own
    judged : whether it counts where a replay is compared with the vehicle sample by sample
    orders_sets : whether its likelihood counts where two replays are asked for the order of sets
    summed : whether it counts in what the ranking shows summed over sources
    place : in the report's lists; 0 where it is not shown
    """

    name: str
    label: str
    unit: str
    axes: int
    quantity: str
    groups: tuple[tuple[str, tuple[int, ...]], ...] = ()
    code: int | None = None
    sensor: str = ""
    part: str = ""
    switch: Switch | None = None
    gate_parameter: str | None = None
    noise_parameters: tuple[str, ...] = ()
    noise_floors: tuple[NoiseFloor, ...] = ()
    acts: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()
    measures: bool = True
    every_update: bool = False
    stops_drift: bool = False
    withheld: bool = False
    innovations: tuple[str, ...] = ()
    ekf2_innovations: tuple[str, ...] = ()
    size_figure: str = ""
    judged: bool = False
    orders_sets: bool = False
    summed: bool = False
    place: int = 0

    @property
    def topic(self) -> str:
        """The topic of its innovations (v1.14 on; before, `px4.layouts.onboard_innovations` makes it)."""
        return AID_SOURCE_TOPIC + self.name

    @property
    def noises(self) -> tuple[str, ...]:
        """Parameters of its noise, those that are floors, too."""
        return (*self.noise_parameters, *(floor.parameter for floor in self.noise_floors))

    @property
    def delay_parameter(self) -> str | None:
        """By which the estimator shifts the time of its measurements, ms."""
        return SENSORS[self.sensor].delay_parameter if self.sensor else None

    @property
    def is_replayed(self) -> bool:
        """Whether the replay has it: it has a code, and its sensor, where it has one, is fed."""
        return self.code is not None and (not self.sensor or SENSORS[self.sensor].buffered)


AID_SOURCE_TOPIC = "estimator_aid_src_"


def vector(name: str, size: int = 3) -> tuple[str, ...]:
    """Names of the columns of an array field."""
    return tuple(f"{name}[{axis}]" for axis in range(size))


def of_vector(name: str, limit: Limit, size: int = 3) -> dict[str, Limit]:
    """The same limit for each column of an array field."""
    return dict.fromkeys(vector(name, size), limit)


_SPEED, _MAYBE_SPEED = Limit(-1e3, 1e3), Limit(-1e3, 1e3, may_be_nan=True)
_MAYBE_VARIANCE = Limit(0.0, 1e9, may_be_nan=True)

# fmt: off
SENSORS: Mapping[str, Sensor] = {sensor.name: sensor for sensor in (
    Sensor("gnss", "GNSS", "EKF2_GPS_DELAY", (SensorTopic(
        "vehicle_gps_position",
        needed=("latitude_deg", "longitude_deg", "altitude_msl_m", "vel_n_m_s", "vel_e_m_s", "vel_d_m_s",
                "s_variance_m_s", "eph", "epv", "fix_type", "satellites_used"),
        limits={
            "latitude_deg": Limit(-90.0, 90.0), "longitude_deg": Limit(-180.0, 180.0),
            "altitude_msl_m": Limit(-5e3, 1e5),
            "vel_n_m_s": _SPEED, "vel_e_m_s": _SPEED, "vel_d_m_s": _SPEED,
            "s_variance_m_s": Limit(0.0, 1e6), "eph": Limit(0.0, 1e7), "epv": Limit(0.0, 1e7),
            "heading": Limit(-7.0, 7.0, may_be_nan=True),
        },
    ),)),
    Sensor("mag", "magnetometer", "EKF2_MAG_DELAY", (SensorTopic(
        "vehicle_magnetometer", vector("magnetometer_ga"), of_vector("magnetometer_ga", Limit(-50.0, 50.0)),
        stamped_by_sample=True, relative_field="vehicle_magnetometer_timestamp_rel",
    ),)),
    Sensor("baro", "barometer", "EKF2_BARO_DELAY", (SensorTopic(
        "vehicle_air_data", ("baro_alt_meter",), {"baro_alt_meter": Limit(-5e3, 1e5), "rho": Limit(0.0, 10.0)},
        stamped_by_sample=True, relative_field="vehicle_air_data_timestamp_rel",
    ),)),
    Sensor("range", "range finder", "EKF2_RNG_DELAY", (SensorTopic(
        "distance_sensor", ("current_distance",), {"current_distance": Limit(-1e4, 1e5, may_be_nan=True)},
        relative_field="distance_sensor_timestamp_rel",
    ),)),
    Sensor("flow", "optical flow", "EKF2_OF_DELAY", (SensorTopic(
        "vehicle_optical_flow",
        needed=(*vector("pixel_flow", 2), *vector("delta_angle"), "integration_timespan_us", "quality"),
        limits=of_vector("pixel_flow", _MAYBE_SPEED, 2) | of_vector("delta_angle", _MAYBE_SPEED),
        since=(1, 14), made_of=("optical_flow",),
        stamped_by_sample=True, relative_field="optical_flow_timestamp_rel",
    ),)),
    Sensor("ev", "external vision", "EKF2_EV_DELAY", (SensorTopic(
        "vehicle_visual_odometry",
        needed=(*vector("position"), *vector("velocity"), *vector("q", 4), "pose_frame", "velocity_frame",
                *vector("position_variance"), *vector("velocity_variance"), *vector("orientation_variance")),
        limits=of_vector("position", Limit(-1e7, 1e7, may_be_nan=True)) | of_vector("velocity", _MAYBE_SPEED)
        | of_vector("q", Limit(-1.5, 1.5, may_be_nan=True), 4),
        since=(1, 9), made_of=("vehicle_vision_position", "vehicle_vision_attitude"),
        stamped_by_sample=True, relative_field="visual_odometry_timestamp_rel",
    ),)),
    Sensor("airspeed", "airspeed", "EKF2_ASP_DELAY", (
        SensorTopic(
            "airspeed_validated", ("true_airspeed_m_s", "calibrated_airspeed_m_s", "airspeed_source"),
            {"true_airspeed_m_s": _MAYBE_SPEED, "calibrated_airspeed_m_s": _MAYBE_SPEED},
            since=(1, 13), relative_field="airspeed_validated_timestamp_rel",
        ),
        SensorTopic(
            "airspeed", ("true_airspeed_m_s", "indicated_airspeed_m_s"),
            {"true_airspeed_m_s": _MAYBE_SPEED, "indicated_airspeed_m_s": _MAYBE_SPEED},
            stamped_by_sample=True, relative_field="airspeed_timestamp_rel",
        ),
    )),
    Sensor("auxvel", "landing target", "EKF2_AVEL_DELAY", (SensorTopic(
        "landing_target_pose", ("vx_rel", "vy_rel", "cov_vx_rel", "cov_vy_rel", "is_static", "rel_vel_valid"),
        {"vx_rel": _MAYBE_SPEED, "vy_rel": _MAYBE_SPEED, "cov_vx_rel": _MAYBE_VARIANCE, "cov_vy_rel": _MAYBE_VARIANCE},
    ),)),
    Sensor("aux_global_position", "an auxiliary position", "EKF2_AGP_DELAY",
           (SensorTopic("aux_global_position", since=(1, 15)),), buffered=False),
)}
"""By name. GNSS, range finders, validated airspeed and landing targets are stamped with `timestamp`, whatever their
sample time says; of GNSS that changed after v1.17."""

SENSOR_TOPICS: Mapping[str, SensorTopic] = {
    topic.name: topic for sensor in SENSORS.values() if sensor.buffered for topic in sensor.topics
}
"""Topics that feed the replay, by name."""

_PLANE = (("horizontal", (0, 1)),)
_SPACE = (("horizontal", (0, 1)), ("vertical", (2,)), ("all", (0, 1, 2)))
_HEIGHT = (("vertical", (0,)),)
_ANGLE = (("heading", (0,)),)
_BIAXIAL = (("all", (0, 1)),)
_TRIAXIAL = (("all", (0, 1, 2)),)

_OLD_VELOCITY, _OLD_POSITION = vector("vel_pos_innov", 6)[:3], vector("vel_pos_innov", 6)[3:5]
_OLD_HEIGHT, _OLD_HEADING = ("vel_pos_innov[5]",), ("heading_innov",)

AID_SOURCES: Mapping[str, AidSource] = {source.name: source for source in (
    AidSource(
        "gnss_pos", "GNSS position", "m", 2, "position", _PLANE, code=5, sensor="gnss",
        switch=Switch("EKF2_GPS_CTRL", 1), gate_parameter="EKF2_GPS_P_GATE",
        noise_floors=(NoiseFloor("EKF2_GPS_P_NOISE", "eph", 1.0),),
        acts=("EKF2_GPS_", "EKF2_GPS_P_", "EKF2_REQ_"), flags=("cs_gnss_pos",), stops_drift=True, withheld=True,
        innovations=vector("gps_hpos", 2), ekf2_innovations=_OLD_POSITION,
        size_figure="horizontal_position", judged=True, orders_sets=True, summed=True, place=2,
    ),
    AidSource(
        "gnss_vel", "GNSS velocity", "m/s", 3, "velocity", _SPACE, code=6, sensor="gnss",
        switch=Switch("EKF2_GPS_CTRL", 4), gate_parameter="EKF2_GPS_V_GATE",
        noise_floors=(NoiseFloor("EKF2_GPS_V_NOISE", "s_variance_m_s", 1.0),),
        acts=("EKF2_GPS_", "EKF2_GPS_V_", "EKF2_REQ_"), flags=("cs_gnss_vel",), stops_drift=True, withheld=True,
        innovations=(*vector("gps_hvel", 2), "gps_vvel"), ekf2_innovations=_OLD_VELOCITY,
        size_figure="horizontal_velocity", judged=True, orders_sets=True, summed=True, place=1,
    ),
    AidSource(
        "gnss_hgt", "GNSS height", "m", 1, "height", _HEIGHT, code=4, sensor="gnss",
        switch=Switch("EKF2_GPS_CTRL", 2), gate_parameter="EKF2_GPS_P_GATE",
        noise_floors=(NoiseFloor("EKF2_GPS_P_NOISE", "epv", 1.5),),
        acts=("EKF2_GPS_", "EKF2_GPS_P_", "EKF2_REQ_"), flags=("cs_gps_hgt",), withheld=True,
        innovations=("gps_vpos",), ekf2_innovations=_OLD_HEIGHT, judged=True, orders_sets=True, summed=True, place=3,
    ),
    AidSource(
        "gnss_yaw", "GNSS heading", "rad", 1, "heading", _ANGLE, code=7, sensor="gnss", part="gnss_yaw",
        switch=Switch("EKF2_GPS_CTRL", 8), gate_parameter="EKF2_HDG_GATE",
        acts=("EKF2_GPS_", "EKF2_GPS_YAW_OFF", "EKF2_HDG_GATE", "EKF2_HEAD_NOISE"), flags=("cs_gnss_yaw",),
        innovations=("heading",), ekf2_innovations=_OLD_HEADING, size_figure="gnss_heading", judged=True,
    ),
    AidSource(
        "baro_hgt", "barometer height", "m", 1, "height", _HEIGHT, code=0, sensor="baro",
        switch=Switch("EKF2_BARO_CTRL"), gate_parameter="EKF2_BARO_GATE", noise_parameters=("EKF2_BARO_NOISE",),
        acts=("EKF2_BARO_", "EKF2_GND_", "EKF2_PCOEF_"), flags=("cs_baro_hgt",), withheld=True,
        innovations=("baro_vpos",), ekf2_innovations=_OLD_HEIGHT, judged=True, orders_sets=True, summed=True, place=4,
    ),
    AidSource(
        "rng_hgt", "range finder height", "m", 1, "height", _HEIGHT, code=1, sensor="range",
        switch=Switch("EKF2_RNG_CTRL"), gate_parameter="EKF2_RNG_GATE",
        noise_parameters=("EKF2_RNG_NOISE", "EKF2_RNG_SFE"),
        acts=("EKF2_RNG_", "EKF2_TERR_"), flags=("cs_rng_hgt",),
        innovations=("rng_vpos",), ekf2_innovations=_OLD_HEIGHT, judged=True, summed=True, place=9,
    ),
    AidSource(
        "mag", "magnetometer", "G", 3, "field", _TRIAXIAL, code=14, sensor="mag",
        switch=Switch("EKF2_MAG_TYPE", off=5.0), gate_parameter="EKF2_MAG_GATE", noise_parameters=("EKF2_MAG_NOISE",),
        acts=("EKF2_MAG_", "EKF2_SYNT_MAG_Z", "EKF2_HEAD_NOISE"), flags=("cs_mag_hdg", "cs_mag_3d", "cs_mag"),
        withheld=True, innovations=vector("mag_field"), ekf2_innovations=vector("mag_innov"),
        size_figure="magnetic_field", judged=True, orders_sets=True, summed=True, place=5,
    ),
    AidSource(
        "mag_heading", "magnetic heading", "rad", 1, "heading", _ANGLE, sensor="mag",
        gate_parameter="EKF2_HDG_GATE", flags=("cs_mag_hdg",),
        innovations=("heading",), ekf2_innovations=_OLD_HEADING, size_figure="heading",
    ),
    AidSource(
        "ev_pos", "vision position", "m", 2, "position", _PLANE, code=9, sensor="ev", part="ev_pos",
        switch=Switch("EKF2_EV_CTRL", 1), gate_parameter="EKF2_EVP_GATE", noise_parameters=("EKF2_EVP_NOISE",),
        acts=("EKF2_EV_", "EKF2_EVP_"), flags=("cs_ev_pos",), stops_drift=True,
        innovations=vector("ev_hpos", 2), ekf2_innovations=_OLD_POSITION,
        size_figure="vision_position", judged=True, summed=True, place=6,
    ),
    AidSource(
        "ev_vel", "vision velocity", "m/s", 3, "velocity", _SPACE, code=10, sensor="ev", part="ev_vel",
        switch=Switch("EKF2_EV_CTRL", 4), gate_parameter="EKF2_EVV_GATE", noise_parameters=("EKF2_EVV_NOISE",),
        acts=("EKF2_EV_", "EKF2_EVV_"), flags=("cs_ev_vel",), stops_drift=True,
        innovations=(*vector("ev_hvel", 2), "ev_vvel"), ekf2_innovations=_OLD_VELOCITY,
        size_figure="vision_velocity", judged=True, summed=True, place=7,
    ),
    AidSource(
        "ev_hgt", "vision height", "m", 1, "height", _HEIGHT, code=8, sensor="ev", part="ev_pos",
        switch=Switch("EKF2_EV_CTRL", 2), gate_parameter="EKF2_EVP_GATE", noise_parameters=("EKF2_EVP_NOISE",),
        acts=("EKF2_EV_", "EKF2_EVP_"), flags=("cs_ev_hgt",),
        innovations=("ev_vpos",), ekf2_innovations=_OLD_HEIGHT, judged=True, summed=True, place=8,
    ),
    AidSource(
        "ev_yaw", "vision heading", "rad", 1, "heading", _ANGLE, code=11, sensor="ev", part="ev_yaw",
        switch=Switch("EKF2_EV_CTRL", 8), gate_parameter="EKF2_HDG_GATE", noise_parameters=("EKF2_EVA_NOISE",),
        acts=("EKF2_EV_", "EKF2_EVA_", "EKF2_HDG_GATE"), flags=("cs_ev_yaw",),
        innovations=("heading",), ekf2_innovations=_OLD_HEADING,
        size_figure="vision_heading", judged=True, summed=True,
    ),
    AidSource(
        "optical_flow", "optical flow", "rad/s", 2, "flow", _BIAXIAL, code=16, sensor="flow",
        switch=Switch("EKF2_OF_CTRL"), gate_parameter="EKF2_OF_GATE",
        noise_parameters=("EKF2_OF_N_MIN", "EKF2_OF_N_MAX"),
        acts=("EKF2_OF_", "EKF2_TERR_"), flags=("cs_opt_flow",), stops_drift=True,
        innovations=vector("flow", 2), ekf2_innovations=vector("flow_innov", 2),
        size_figure="optical_flow", judged=True, place=10,
    ),
    AidSource(
        "airspeed", "airspeed", "m/s", 1, "airspeed", code=12, sensor="airspeed",
        switch=Switch("EKF2_ARSP_THR"), gate_parameter="EKF2_TAS_GATE", noise_parameters=("EKF2_EAS_NOISE",),
        acts=("EKF2_TAS_GATE", "EKF2_EAS_NOISE", "EKF2_ASP_DELAY", "EKF2_ARSP_THR", "EKF2_WIND_N"),
        flags=("cs_fuse_aspd",), innovations=("airspeed",), ekf2_innovations=("airspeed_innov",),
    ),
    AidSource(
        "sideslip", "sideslip", "rad", 1, "sideslip", code=13,
        switch=Switch("EKF2_FUSE_BETA"), gate_parameter="EKF2_BETA_GATE", noise_parameters=("EKF2_BETA_NOISE",),
        acts=("EKF2_BETA_", "EKF2_FUSE_BETA", "EKF2_WIND_N"), flags=("cs_fuse_beta",),
        innovations=("beta",), ekf2_innovations=("beta_innov",),
    ),
    AidSource(
        "drag", "drag acceleration", "m/s²", 2, "drag", _BIAXIAL, code=19,
        switch=Switch("EKF2_DRAG_CTRL"), noise_parameters=("EKF2_DRAG_NOISE",),
        acts=("EKF2_DRAG_", "EKF2_BCOEF_", "EKF2_MCOEF", "EKF2_WIND_N"),
        innovations=vector("drag", 2), ekf2_innovations=vector("drag_innov", 2),
    ),
    AidSource(
        "gravity", "gravity direction", "m/s²", 3, "gravity", _TRIAXIAL, code=15,
        switch=Switch("EKF2_IMU_CTRL", 4), acts=("EKF2_GRAV_NOISE",), flags=("cs_gravity_vector",), every_update=True,
        innovations=vector("gravity"),
    ),
    AidSource(
        "aux_vel", "auxiliary velocity", "m/s", 2, "velocity", _PLANE, code=17, sensor="auxvel",
        acts=("EKF2_AVEL_DELAY",), stops_drift=True,
        innovations=vector("aux_hvel", 2), ekf2_innovations=vector("aux_vel_innov", 2),
    ),
    AidSource(
        "aux_global_position", "auxiliary position", "m", 2, "position", _PLANE, code=18, sensor="aux_global_position",
        switch=Switch("EKF2_AGP_CTRL"), gate_parameter="EKF2_AGP_GATE",
        acts=("EKF2_AGP_",), flags=("cs_aux_gpos",), stops_drift=True,
    ),
    AidSource(
        "terrain_range_finder", "height above ground", "m", 1, "height", _HEIGHT, sensor="range",
        gate_parameter="EKF2_RNG_GATE", measures=False,
    ),
    AidSource(
        "terrain_optical_flow", "optical flow over the terrain", "rad/s", 2, "flow", _BIAXIAL, sensor="flow",
        gate_parameter="EKF2_OF_GATE", measures=False,
    ),
    AidSource("fake_hgt", "fake height", "m", 1, "height", code=2, flags=("cs_fake_hgt",), measures=False),
    AidSource("fake_pos", "fake position", "m", 2, "position", code=3, flags=("cs_fake_pos",), measures=False),
)}
# fmt: on
"""Every aid source by name, in the order in which figures are made and shown.

Sources without a code are those of `OLD_SOURCES`; auxiliary positions are known but not replayed."""

MEASURED_SOURCES: Mapping[str, AidSource] = {source.name: source for source in AID_SOURCES.values() if source.measures}
"""Sources that measure something: those that are scored."""

REPLAYED_SOURCES: tuple[str, ...] = tuple(
    source.name
    for source in sorted(
        (source for source in AID_SOURCES.values() if source.code is not None), key=lambda one: one.code or 0
    )
)
"""Sources of the estimator of v1.16 and later, by their codes."""

OLD_SOURCES: tuple[str, ...] = ("mag_heading", "terrain_range_finder", "terrain_optical_flow")
"""Sources that only older estimators have: the heading until v1.14, the filter of the terrain alone until v1.15."""

RECORDED_SOURCES: tuple[str, ...] = REPLAYED_SOURCES + OLD_SOURCES
"""Sources of the replay of any release, by the number that its rows have."""

WITHHOLDABLE: Mapping[str, tuple[str, ...]] = {
    source.sensor: tuple(one.name for one in AID_SOURCES.values() if one.sensor == source.sensor and one.withheld)
    for source in AID_SOURCES.values()
    if source.withheld
}
"""Sensor → the aid sources whose innovations go on while it is withheld; gaps are planned in this order."""

HORIZONTAL_AIDING: tuple[str, ...] = tuple(one.name for one in AID_SOURCES.values() if one.stops_drift)
"""Sources that stop the horizontal drift; the warm-up ends some seconds after the first of them is fused."""

REPORTED_SOURCES: tuple[AidSource, ...] = tuple(
    sorted((one for one in AID_SOURCES.values() if one.place), key=lambda one: one.place)
)
"""Sources that the report shows, in its order."""
