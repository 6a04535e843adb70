"""The aid sources whose innovations are scored: their axes, units, gates and delays."""

from dataclasses import dataclass

AXES = ("x", "y", "z")
"""Names of the axes 0, 1, 2 of a source; its meaning (NED, body, …) is that of the source."""


@dataclass(frozen=True)
class AidSource:
    """One aid source as PX4 names it.

    Attributes
    ----------
    groups : name of an aggregate and the axes that it joins, e.g. `("horizontal", (0, 1))`
    gate_parameter : the gate, in standard deviations (test ratio = ν² / (gate² S))
    delay_parameter : by which the estimator shifts the time of a measurement, ms
    """

    name: str
    label: str
    unit: str
    axes: int
    groups: tuple[tuple[str, tuple[int, ...]], ...]
    gate_parameter: str | None
    delay_parameter: str | None


_PLANE = (("horizontal", (0, 1)),)
_SPACE = (("horizontal", (0, 1)), ("vertical", (2,)), ("all", (0, 1, 2)))
_HEIGHT = (("vertical", (0,)),)
_ANGLE = (("heading", (0,)),)
_BIAXIAL = (("all", (0, 1)),)
_TRIAXIAL = (("all", (0, 1, 2)),)

AID_SOURCES: dict[str, AidSource] = {
    source.name: source
    for source in (
        AidSource("gnss_pos", "GNSS position", "m", 2, _PLANE, "EKF2_GPS_P_GATE", "EKF2_GPS_DELAY"),
        AidSource("gnss_vel", "GNSS velocity", "m/s", 3, _SPACE, "EKF2_GPS_V_GATE", "EKF2_GPS_DELAY"),
        AidSource("gnss_hgt", "GNSS height", "m", 1, _HEIGHT, "EKF2_GPS_P_GATE", "EKF2_GPS_DELAY"),
        AidSource("gnss_yaw", "GNSS heading", "rad", 1, _ANGLE, "EKF2_HDG_GATE", "EKF2_GPS_DELAY"),
        AidSource("baro_hgt", "barometer height", "m", 1, _HEIGHT, "EKF2_BARO_GATE", "EKF2_BARO_DELAY"),
        AidSource("rng_hgt", "range finder height", "m", 1, _HEIGHT, "EKF2_RNG_GATE", "EKF2_RNG_DELAY"),
        AidSource("mag", "magnetometer", "G", 3, _TRIAXIAL, "EKF2_MAG_GATE", "EKF2_MAG_DELAY"),
        AidSource("mag_heading", "magnetic heading", "rad", 1, _ANGLE, "EKF2_HDG_GATE", "EKF2_MAG_DELAY"),
        AidSource("ev_pos", "vision position", "m", 2, _PLANE, "EKF2_EVP_GATE", "EKF2_EV_DELAY"),
        AidSource("ev_vel", "vision velocity", "m/s", 3, _SPACE, "EKF2_EVV_GATE", "EKF2_EV_DELAY"),
        AidSource("ev_hgt", "vision height", "m", 1, _HEIGHT, "EKF2_EVP_GATE", "EKF2_EV_DELAY"),
        AidSource("ev_yaw", "vision heading", "rad", 1, _ANGLE, "EKF2_HDG_GATE", "EKF2_EV_DELAY"),
        AidSource("optical_flow", "optical flow", "rad/s", 2, _BIAXIAL, "EKF2_OF_GATE", "EKF2_OF_DELAY"),
        AidSource("airspeed", "airspeed", "m/s", 1, (), "EKF2_TAS_GATE", "EKF2_ASP_DELAY"),
        AidSource("sideslip", "sideslip", "rad", 1, (), "EKF2_BETA_GATE", None),
        AidSource("drag", "drag acceleration", "m/s²", 2, _BIAXIAL, None, None),
        AidSource("gravity", "gravity direction", "m/s²", 3, _TRIAXIAL, None, None),
        AidSource("aux_vel", "auxiliary velocity", "m/s", 2, _PLANE, None, "EKF2_AVEL_DELAY"),
        AidSource("aux_global_position", "auxiliary position", "m", 2, _PLANE, "EKF2_AGP_GATE", "EKF2_AGP_DELAY"),
    )
}
"""Every source that measures something; `fake_pos`, `fake_hgt` and the like are the filter's own inventions.

`mag_heading` exists only as flown, in releases before v1.16."""

HORIZONTAL_AIDING = ("gnss_vel", "gnss_pos", "ev_vel", "ev_pos", "optical_flow", "aux_vel", "aux_global_position")
"""Sources that stop the horizontal drift; the warm-up ends some seconds after the first of them is fused."""
