"""Flag records of the estimator, with the names of `estimator_status_flags` (without their prefix)."""

import numpy as np

CONTROL_STATUS_NAMES = (
    "tilt_align", "yaw_align", "gnss_pos", "opt_flow", "mag_hdg", "mag_3d", "mag_dec", "in_air", "wind", "baro_hgt",
    "rng_hgt", "gps_hgt", "ev_pos", "ev_yaw", "ev_hgt", "fuse_beta", "mag_field_disturbed", "fixed_wing", "mag_fault",
    "fuse_aspd", "gnd_effect", "rng_stuck", "gnss_yaw", "mag_aligned_in_flight", "ev_vel", "synthetic_mag_z",
    "vehicle_at_rest", "gnss_yaw_fault", "rng_fault", "inertial_dead_reckoning", "wind_dead_reckoning",
    "rng_kin_consistent", "fake_pos", "fake_hgt", "gravity_vector", "mag", "ev_yaw_fault", "mag_heading_consistent",
    "aux_gpos", "rng_terrain", "opt_flow_terrain", "valid_fake_pos", "constant_pos", "baro_fault", "gnss_vel",
)  # fmt: skip
FAULT_STATUS_NAMES = (
    "bad_mag_x", "bad_mag_y", "bad_mag_z", "bad_hdg", "bad_mag_decl", "bad_airspeed", "bad_sideslip", "bad_optflow_x",
    "bad_optflow_y", "bad_acc_vertical", "bad_acc_clipping",
)  # fmt: skip
REJECTION_NAMES = (
    "hor_vel", "ver_vel", "hor_pos", "ver_pos", "yaw", "airspeed", "sideslip", "hagl", "optflow_x", "optflow_y",
)  # fmt: skip
EVENT_NAMES = (
    "gps_checks_passed", "reset_vel_to_gps", "reset_vel_to_flow", "reset_vel_to_vision", "reset_vel_to_zero",
    "reset_pos_to_last_known", "reset_pos_to_gps", "reset_pos_to_vision", "starting_gps_fusion",
    "starting_vision_pos_fusion", "starting_vision_vel_fusion", "starting_vision_yaw_fusion",
    "yaw_aligned_to_imu_gps", "reset_hgt_to_baro", "reset_hgt_to_gps", "reset_hgt_to_rng", "reset_hgt_to_ev",
    "reset_pos_to_ext_obs", "reset_wind_to_ext_obs",
)  # fmt: skip


def _flags(names: tuple[str, ...]) -> np.dtype:
    return np.dtype([(name, "?") for name in names])


CONTROL_STATUS = _flags(CONTROL_STATUS_NAMES)
FAULT_STATUS = _flags(FAULT_STATUS_NAMES)
INNOVATION_REJECTION = _flags(REJECTION_NAMES)
INFORMATION_EVENTS = _flags(EVENT_NAMES)
