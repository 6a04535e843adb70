"""What the status flags of EKF2 say, in words: those that matter on a flight."""

from __future__ import annotations

from collections.abc import Mapping

_STATE_WORDS: Mapping[str, str] = {
    "cs_tilt_align": "tilt known",
    "cs_yaw_align": "heading known",
    "cs_vehicle_at_rest": "at rest",
    "cs_gnss_pos": "GNSS position fused",
    "cs_gnss_vel": "GNSS velocity fused",
    "cs_gps_hgt": "GNSS height fused",
    "cs_gnss_yaw": "GNSS heading fused",
    "cs_baro_hgt": "barometer height fused",
    "cs_rng_hgt": "range finder height fused",
    "cs_rng_terrain": "range finder tells the terrain",
    "cs_mag_hdg": "magnetic heading fused",
    "cs_mag_3d": "magnetometer fused in three axes",
    "cs_mag": "magnetometer fused",
    "cs_opt_flow": "optical flow fused",
    "cs_opt_flow_terrain": "optical flow tells the terrain",
    "cs_ev_pos": "vision position fused",
    "cs_ev_vel": "vision velocity fused",
    "cs_ev_yaw": "vision heading fused",
    "cs_ev_hgt": "vision height fused",
    "cs_aux_gpos": "auxiliary position fused",
    "cs_fuse_aspd": "airspeed fused",
    "cs_fuse_beta": "sideslip fused",
    "cs_wind": "wind estimated",
    "cs_gravity_vector": "gravity direction fused",
    "cs_gnd_effect": "ground effect expected",
}
_ALARM_WORDS: Mapping[str, str] = {
    "cs_inertial_dead_reckoning": "dead reckoning by the IMU alone",
    "cs_wind_dead_reckoning": "dead reckoning by airspeed or drag",
    "cs_fake_pos": "no position: held in place",
    "cs_fake_hgt": "no height: held in place",
    "cs_valid_fake_pos": "position held in place, at rest",
    "cs_constant_pos": "position held constant",
    "cs_mag_field_disturbed": "magnetic field disturbed",
    "cs_mag_fault": "magnetometer declared faulty",
    "cs_gnss_yaw_fault": "GNSS heading declared faulty",
    "cs_ev_yaw_fault": "vision heading declared faulty",
    "cs_rng_fault": "range finder declared faulty",
    "cs_rng_stuck": "range finder stuck",
    "cs_baro_fault": "barometer declared faulty",
    "reject_hor_vel": "horizontal velocity rejected",
    "reject_ver_vel": "vertical velocity rejected",
    "reject_hor_pos": "horizontal position rejected",
    "reject_ver_pos": "height rejected",
    "reject_mag_x": "magnetometer x rejected",
    "reject_mag_y": "magnetometer y rejected",
    "reject_mag_z": "magnetometer z rejected",
    "reject_yaw": "heading rejected",
    "reject_airspeed": "airspeed rejected",
    "reject_sideslip": "sideslip rejected",
    "reject_hagl": "height above ground rejected",
    "reject_optflow_x": "optical flow x rejected",
    "reject_optflow_y": "optical flow y rejected",
    "fs_bad_mag_x": "numerical fault: magnetometer x",
    "fs_bad_mag_y": "numerical fault: magnetometer y",
    "fs_bad_mag_z": "numerical fault: magnetometer z",
    "fs_bad_hdg": "numerical fault: heading",
    "fs_bad_mag_decl": "numerical fault: declination",
    "fs_bad_airspeed": "numerical fault: airspeed",
    "fs_bad_sideslip": "numerical fault: sideslip",
    "fs_bad_optflow_x": "numerical fault: optical flow x",
    "fs_bad_optflow_y": "numerical fault: optical flow y",
    "fs_bad_vel_n": "numerical fault: velocity north",
    "fs_bad_vel_e": "numerical fault: velocity east",
    "fs_bad_vel_d": "numerical fault: velocity down",
    "fs_bad_pos_n": "numerical fault: position north",
    "fs_bad_pos_e": "numerical fault: position east",
    "fs_bad_pos_d": "numerical fault: position down",
    "fs_bad_acc_bias": "fault: bias of the accelerometer",
    "fs_bad_acc_vertical": "fault: vertical acceleration against height",
    "fs_bad_acc_clipping": "fault: the accelerometer clips",
}

GNSS_CHECK_WORDS = (
    "no three-dimensional fix",
    "too few satellites",
    "PDOP too large",
    "horizontal accuracy too poor",
    "vertical accuracy too poor",
    "speed accuracy too poor",
    "position drifts horizontally at rest",
    "position drifts vertically at rest",
    "horizontal speed at rest",
    "vertical speed against the filter's",
    "spoofed, as the receiver says",
)
"""Bits of `estimator_status.gps_check_fail_flags`, from the lowest: the fix, then those of EKF2_GPS_CHECK."""

STATES = tuple(_STATE_WORDS)
"""What the filter does."""
USUAL = frozenset({"cs_tilt_align", "cs_yaw_align"})
"""What says nothing where it holds throughout the flight."""
ALARMS = tuple(_ALARM_WORDS)
"""What is wrong while it lasts."""
FLAG_WORDS: Mapping[str, str] = {**_STATE_WORDS, **_ALARM_WORDS}
