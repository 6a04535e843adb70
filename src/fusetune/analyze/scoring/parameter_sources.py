"""Which aid sources a parameter of the estimator works through, and what switches these on, in PX4 v1.16."""

from collections.abc import Mapping

REQUIRED_SOURCES: dict[str, tuple[str, ...]] = {
    "EKF2_GPS_": ("gnss_pos", "gnss_vel", "gnss_hgt", "gnss_yaw"),
    "EKF2_GPS_V_": ("gnss_vel",),
    "EKF2_GPS_P_": ("gnss_pos", "gnss_hgt"),
    "EKF2_GPS_YAW_OFF": ("gnss_yaw",),
    "EKF2_REQ_": ("gnss_pos", "gnss_vel", "gnss_hgt"),
    "EKF2_HDG_GATE": ("gnss_yaw", "ev_yaw"),
    "EKF2_BARO_": ("baro_hgt",),
    "EKF2_GND_": ("baro_hgt",),
    "EKF2_PCOEF_": ("baro_hgt",),
    "EKF2_RNG_": ("rng_hgt",),
    "EKF2_TERR_": ("rng_hgt", "optical_flow"),
    "EKF2_MAG_": ("mag",),
    "EKF2_SYNT_MAG_Z": ("mag",),
    "EKF2_HEAD_NOISE": ("mag", "gnss_yaw"),
    "EKF2_EVP_": ("ev_pos", "ev_hgt"),
    "EKF2_EVV_": ("ev_vel",),
    "EKF2_EVA_": ("ev_yaw",),
    "EKF2_EV_": ("ev_pos", "ev_vel", "ev_hgt", "ev_yaw"),
    "EKF2_OF_": ("optical_flow",),
    "EKF2_TAS_GATE": ("airspeed",),
    "EKF2_EAS_NOISE": ("airspeed",),
    "EKF2_ASP_DELAY": ("airspeed",),
    "EKF2_ARSP_THR": ("airspeed",),
    "EKF2_BETA_": ("sideslip",),
    "EKF2_FUSE_BETA": ("sideslip",),
    "EKF2_WIND_N": ("airspeed", "sideslip", "drag"),
    "EKF2_DRAG_": ("drag",),
    "EKF2_BCOEF_": ("drag",),
    "EKF2_MCOEF": ("drag",),
    "EKF2_GRAV_NOISE": ("gravity",),
    "EKF2_AGP_": ("aux_global_position",),
    "EKF2_AVEL_DELAY": ("aux_vel",),
}
"""Start of a parameter's name → sources of which at least one must be fused for it to act."""

OBSERVATION_NOISE: dict[str, tuple[str, ...]] = {
    "EKF2_BARO_NOISE": ("baro_hgt",),
    "EKF2_RNG_NOISE": ("rng_hgt",),
    "EKF2_RNG_SFE": ("rng_hgt",),
    "EKF2_MAG_NOISE": ("mag",),
    "EKF2_EVP_NOISE": ("ev_pos", "ev_hgt"),
    "EKF2_EVV_NOISE": ("ev_vel",),
    "EKF2_EVA_NOISE": ("ev_yaw",),
    "EKF2_OF_N_MIN": ("optical_flow",),
    "EKF2_OF_N_MAX": ("optical_flow",),
    "EKF2_EAS_NOISE": ("airspeed",),
    "EKF2_BETA_NOISE": ("sideslip",),
    "EKF2_DRAG_NOISE": ("drag",),
}
"""Parameter → sources into whose observation variance, and into little else, it goes. The two GNSS floors are not
among them: the receiver's reports tell about these, and tell why."""

_SWITCHES: dict[str, tuple[str, int]] = {
    "gnss_pos": ("EKF2_GPS_CTRL", 1),
    "gnss_hgt": ("EKF2_GPS_CTRL", 2),
    "gnss_vel": ("EKF2_GPS_CTRL", 4),
    "gnss_yaw": ("EKF2_GPS_CTRL", 8),
    "ev_pos": ("EKF2_EV_CTRL", 1),
    "ev_hgt": ("EKF2_EV_CTRL", 2),
    "ev_vel": ("EKF2_EV_CTRL", 4),
    "ev_yaw": ("EKF2_EV_CTRL", 8),
    "baro_hgt": ("EKF2_BARO_CTRL", -1),
    "rng_hgt": ("EKF2_RNG_CTRL", -1),
    "optical_flow": ("EKF2_OF_CTRL", -1),
    "drag": ("EKF2_DRAG_CTRL", -1),
    "sideslip": ("EKF2_FUSE_BETA", -1),
    "aux_global_position": ("EKF2_AGP_CTRL", -1),
    "gravity": ("EKF2_IMU_CTRL", 4),
}
"""Source → the parameter that switches it, and the bits of it that must not all be 0 (−1: any)."""

_MAG_NONE = 5


def required_sources(parameter: str) -> tuple[str, ...]:
    """Sources of which one must be fused for a parameter to act; empty where it acts without any."""
    for prefix in sorted(REQUIRED_SOURCES, key=len, reverse=True):
        if parameter.startswith(prefix):
            return REQUIRED_SOURCES[prefix]
    return ()


def switched_off(source: str, parameters: Mapping[str, float]) -> str:
    """The parameter setting that keeps a source from being fused, in words, or an empty text."""
    if source == "mag":
        return "EKF2_MAG_TYPE is 5" if parameters.get("EKF2_MAG_TYPE") == _MAG_NONE else ""
    if source == "airspeed":
        return "EKF2_ARSP_THR is 0" if parameters.get("EKF2_ARSP_THR", 1.0) <= 0.0 else ""
    if source not in _SWITCHES:
        return ""
    name, bits = _SWITCHES[source]
    value = parameters.get(name)
    return f"{name} is {int(value)}" if value is not None and not int(value) & bits else ""
