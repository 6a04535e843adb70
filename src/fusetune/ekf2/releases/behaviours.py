"""Named behaviours: what the estimators of other releases do otherwise than v1.16's, which the kernels themselves tell.

A behaviour says what is done, by which releases, and where PX4 does it. All of those of a release are fixed when a
replay is built: kernels are compiled for the release, and hold no others (`by_release.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType

from fusetune.px4 import releases
from fusetune.px4.releases import name_of

BASELINE = name_of(releases.BASELINE)
"""The release whose behaviour is the plain text of the kernels."""

RELEASES = ("v1.13", "v1.14", "v1.15", BASELINE, "v1.17", "main")
"""From the oldest to the newest; `main` is PX4's development branch of May 2026."""


def _behaviour(what: str, *, since: str, source: str, until: str = RELEASES[-1]) -> bool:
    """Declare a behaviour of the releases `since` … `until`, both included, with its place below PX4's `ekf2/EKF`."""
    assert RELEASES.index(since) <= RELEASES.index(until)
    declared: bool = field(default=False, metadata={"what": what, "since": since, "until": until, "source": source})
    return declared


@dataclass(frozen=True)
class Behaviours:
    """What a release does otherwise than v1.16; a behaviour that is not named here is that of v1.16."""

    levels_at_the_horizon: bool = _behaviour(
        "The tilt starts from filters of the IMU samples at the fusion time horizon, which go on running; the mean "
        "interval starts with the first of them, not with 10 ms, and runs before the filter does. v1.16 filters the "
        "newest samples.",
        since="v1.17",
        source="ekf.cpp",
    )
    simplifies_gnss_checks: bool = _behaviour(
        "Once the GNSS checks have passed for EKF2_REQ_GPS_H, only fix, accuracies with wide limits and spoofing are "
        "checked; the fix by EKF2_REQ_FIX, and only if its bit of EKF2_GPS_CHECK is set. v1.16 runs all checks all the "
        "time.",
        since="v1.17",
        source="aid_sources/gnss/gnss_checks.cpp",
    )
    controls_gnss_sources_apart: bool = _behaviour(
        "GNSS velocity and position start without a reset where they agree, and are each reset or stopped by the time "
        "since they were fused themselves, as EKF2_GPS_MODE allows. v1.16 resets both by one rule.",
        since="v1.17",
        source="aid_sources/gnss/gps_control.cpp",
    )
    repeats_yaw_emergency_resets: bool = _behaviour(
        "The yaw is reset to the yaw estimator's also in an update in which it was reset already.",
        since="v1.17",
        source="aid_sources/gnss/gps_control.cpp",
    )
    faults_gnss_height: bool = _behaviour(
        "GNSS height that fails while another source works counts as faulty where EKF2_GPS_MODE allows no reset; its "
        "bias is learnt only while it is fused, and the origin's altitude is set before and apart from its start.",
        since="v1.17",
        source="aid_sources/gnss/gnss_height_control.cpp",
    )
    aligns_field_with_heading: bool = _behaviour(
        "The field counts as aligned in flight only by a reset that takes the heading along, and only a fused heading "
        "calls for that at 1.5 m above ground.",
        since="v1.17",
        source="aid_sources/magnetometer/mag_control.cpp",
    )
    keeps_level_gyro_bias: bool = _behaviour(
        "A magnetometer that corrects yaw but not tilt leaves the gyro bias about x and y alone, too, and so does the "
        "declination.",
        since="v1.17",
        source="aid_sources/magnetometer/mag_fusion.cpp",
    )
    levels_by_steady_gravity: bool = _behaviour(
        "Gravity is fused only once the tilt is aligned, while the low-passed specific force is near 1 g, and counts "
        "as fused only if it was. v1.16 takes a decaying maximum.",
        since="v1.17",
        source="aid_sources/gravity/gravity_fusion.cpp",
    )
    yields_to_gravity: bool = _behaviour(
        "The fake position makes way for gravity only while that is fused; without aiding the accelerometer bias is "
        "learnt along the vertical alone, with gravity, too.",
        since="v1.17",
        source="aid_sources/fake_pos_control.cpp, ekf_helper.cpp",
    )
    skips_unhealthy_range: bool = _behaviour(
        "A range sample that is unhealthy or inconsistent is left out and does not stop the fusion; a healthy one "
        "starts it. Conditional aid is the height reference while it lasts; else the reference is chosen anew, so that "
        "another source takes it from range.",
        since="v1.17",
        source="aid_sources/range_finder/range_height_control.cpp",
    )
    scales_terrain_to_flow: bool = _behaviour(
        "A terrain that is reset to optical flow is put where the aided velocity would cause that flow. v1.16 puts it "
        "right below.",
        since="v1.17",
        source="aid_sources/optical_flow/optical_flow_control.cpp",
    )
    correlates_wind_always: bool = _behaviour(
        "The covariance of the wind states follows every fusion, also while the wind is not estimated; the states "
        "themselves stay then.",
        since="v1.17",
        source="ekf_helper.cpp",
    )
    resets_horizontal_velocity_at_once: bool = _behaviour(
        "A reset of the horizontal velocity uncorrelates north and east together; an axis of unknown variance keeps "
        "the one it has.",
        since="v1.17",
        source="velocity_fusion.cpp",
    )
    forces_given_position: bool = _behaviour(
        "A position given from outside is fused with a gain of one on the position itself.",
        since="v1.17",
        source="ekf.cpp",
    )

    holds_unobservable_heading: bool = _behaviour(
        "While nothing makes the heading observable, no fusion changes it, and its variance is uncorrelated and at "
        "most EKF2_HEAD_NOISE squared. v1.17 and before fuse a heading innovation of zero.",
        since="main",
        source="ekf_helper.cpp, covariance.cpp, control.cpp",
    )
    checks_gnss_strictly_on_ground: bool = _behaviour(
        "On the ground all GNSS checks are run, even after they have passed; in the air the simplified ones.",
        since="main",
        source="aid_sources/gnss/gnss_checks.cpp",
    )
    starts_gnss_within_gates: bool = _behaviour(
        "GNSS starts without a reset where north and east each pass the gate. v1.17 asks for a sum of test ratios "
        "below 0.25.",
        since="main",
        source="aid_sources/gnss/gps_control.cpp",
    )
    blames_yaw_for_rejections: bool = _behaviour(
        "The emergency reset of the yaw needs a rejected velocity, or position, that has not been fused for 1 s.",
        since="main",
        source="aid_sources/gnss/gps_control.cpp",
    )
    tells_yaw_estimator_deviation: bool = _behaviour(
        "The yaw estimator is given the standard deviation of the velocity, and that is compared with EKF2_REQ_SACC. "
        "v1.15 to v1.17 take the variance for it.",
        since="main",
        source="aid_sources/gnss/gps_control.cpp",
    )
    stamps_gnss_by_message: bool = _behaviour(
        "The time of a GNSS measurement is the one that its message tells, not that of the message less "
        "EKF2_GPS_DELAY; where the message tells none, that remains.",
        since="main",
        source="../EKF2.cpp",
    )
    trusts_mag_again: bool = _behaviour(
        "A magnetometer at fault is used again once its heading is consistent and no heading was fused for 7 s; no "
        "heading is fused while the position is said to be constant.",
        since="main",
        source="aid_sources/magnetometer/mag_control.cpp",
    )
    aligns_field_on_climb: bool = _behaviour(
        "The field is aligned in flight by the reset at 1.5 m above ground alone, which takes the heading along only "
        "without north-east aiding.",
        since="main",
        source="aid_sources/magnetometer/mag_control.cpp",
    )
    doubts_present_heading: bool = _behaviour(
        "The magnetic heading is consistent only while both the low-passed and the present innovation are small.",
        since="main",
        source="aid_sources/magnetometer/mag_control.cpp",
    )
    counts_vision_to_north_east: bool = _behaviour(
        "Position of vision is north-east aiding, too, once the yaw is aligned.",
        since="main",
        source="estimator_interface.cpp",
    )
    stamps_vision_velocity: bool = _behaviour(
        "Vision velocity in a local frame carries the time of its sample, so it is published. Before, it carries none.",
        since="main",
        source="aid_sources/external_vision/ev_vel.h",
    )
    turns_velocity_with_yaw: bool = _behaviour(
        "A yaw reset by more than 0.3 rad turns the horizontal velocity along, without north-east aiding.",
        since="main",
        source="yaw_fusion.cpp",
    )
    shifts_active_biases: bool = _behaviour(
        "A reset of height or position shifts the biases of active sources alone.",
        since="main",
        source="position_fusion.cpp",
    )
    holds_range_motion: bool = _behaviour(
        "Horizontal motion keeps the range finder from being called inconsistent for 2 s. v1.14 to v1.17 compare "
        "seconds with microseconds.",
        since="main",
        source="aid_sources/range_finder/range_finder_consistency_check.cpp",
    )
    knows_height_by_range: bool = _behaviour(
        "With the range finder as height reference the height above ground counts as known, so flow can start.",
        since="main",
        source="aid_sources/optical_flow/optical_flow_control.cpp",
    )
    levers_vision_attitude: bool = _behaviour(
        "The uncertain attitude of vision adds to its position variance by the lever of the position. v1.17 takes the "
        "larger of the two variances. The height is turned only where the frame is FRD.",
        since="main",
        source="aid_sources/external_vision/ev_pos_control.cpp, aid_sources/external_vision/ev_height_control.cpp",
    )
    keeps_airspeed_to_wings: bool = _behaviour(
        "Airspeed is fused on a fixed wing alone; it starts by a reset of the velocity when dead reckoning, else of an "
        "unknown wind, else by being fused.",
        since="main",
        source="aid_sources/airspeed/airspeed_fusion.cpp",
    )
    reduces_variances_once: bool = _behaviour(
        "A variance beyond its limit is reduced once per update, not until it is within.",
        since="main",
        source="covariance.cpp",
    )

    # Older releases: state, covariance, biases, start and buffers.

    keeps_position_local: bool = _behaviour(
        "Position is metres north, east and down of the origin, a map projection on a sphere, kept in single "
        "precision. v1.16 keeps latitude, longitude and altitude on the ellipsoid.",
        since="v1.13",
        until="v1.15",
        source="ekf.cpp, position_fusion.cpp",
    )
    flies_over_flat_earth: bool = _behaviour(
        "Velocity is integrated without Coriolis and transport rate, within 1000 m/s; the rotation of the Earth is set "
        "where the magnetic model is looked up, and not by the latitude of the estimate.",
        since="v1.13",
        until="v1.15",
        source="ekf.cpp, gps_checks.cpp",
    )
    filters_motion_plainly: bool = _behaviour(
        "The height rate is low-passed after the state is predicted, with the interval over the time constant, and the "
        "horizontal acceleration is a decaying sum of velocity increments. v1.16 uses first-order filters.",
        since="v1.13",
        until="v1.15",
        source="ekf.cpp",
    )
    filters_terrain_apart: bool = _behaviour(
        "The terrain is no state of the filter; a filter of its own estimates it.",
        since="v1.13",
        until="v1.15",
        source="terrain_estimator.cpp",
    )
    adds_noise_to_estimated_states: bool = _behaviour(
        "Biases drift unless their axis is inhibited, field and wind only while they are estimated, whatever their "
        "variances. v1.16 adds no noise above a limit.",
        since="v1.15",
        until="v1.15",
        source="covariance.cpp",
    )
    clips_variances: bool = _behaviour(
        "A variance beyond its limit is cut to it. v1.16 reduces it by fusing an innovation of zero.",
        since="v1.15",
        until="v1.15",
        source="covariance.cpp",
    )
    judges_measured_motion: bool = _behaviour(
        "Whether the vehicle manoeuvres too hard to learn biases is told by rate and specific force as they are "
        "measured. v1.16 takes the biases off first.",
        since="v1.13",
        until="v1.15",
        source="ekf_helper.cpp",
    )
    doubts_stuck_accel_bias: bool = _behaviour(
        "An accelerometer bias that is near its limit, in a direction that innovations of height and vertical velocity "
        "contradict for 7 s, gets the variances of the start.",
        since="v1.15",
        until="v1.15",
        source="height_control.cpp",
    )
    counts_clipping_of_any_axis: bool = _behaviour(
        "Clipping of any axis is counted in one; any count is frequent, more than half of a second's is a fault. v1.16 "
        "counts every axis.",
        since="v1.13",
        until="v1.15",
        source="height_control.cpp",
    )
    tells_fused_gravity: bool = _behaviour(
        "Gravity is told as fused only where it was. v1.16 tells it at every update.",
        since="v1.14",
        until="v1.15",
        source="gravity_fusion.cpp",
    )
    keeps_position_at_velocity_resets: bool = _behaviour(
        "A reset of the velocity leaves the covariances of the position among themselves and with other states.",
        since="v1.13",
        until="v1.15",
        source="velocity_fusion.cpp",
    )
    adds_quaternion_errors: bool = _behaviour(
        "Attitude errors are additive in the four elements of the quaternion. Updates have no Joseph form, and one "
        "that would make a variance negative is refused; states are limited once per prediction; covariances of what "
        "is not estimated are zero, and variances of biases that are not learnt are kept. v1.16's errors turn about "
        "north, east and down.",
        since="v1.13",
        until="v1.14",
        source="covariance.cpp, ekf_helper.cpp, vel_pos_fusion.cpp",
    )
    keeps_biases_as_increments: bool = _behaviour(
        "Biases of gyro and accelerometer are increments of angle and velocity over the mean interval of the filter. "
        "v1.16 keeps rates.",
        since="v1.13",
        until="v1.14",
        source="ekf.h",
    )
    sizes_buffers_by_sources: bool = _behaviour(
        "Buffers are as long as the longest delay of a source that is asked for. v1.16 has EKF2_DELAY_MAX.",
        since="v1.13",
        until="v1.14",
        source="estimator_interface.cpp",
    )
    waits_for_averaged_sensors: bool = _behaviour(
        "Buffers are as long as the longest interval of barometer and magnetometer, too. v1.14 has the same lines, but "
        "where GNSS is not asked for its outputs show the shorter buffers.",
        since="v1.13",
        until="v1.13",
        source="../EKF2.cpp",
    )
    observes_acceleration_of_gravity: bool = _behaviour(
        "Gravity is fused in m/s², by the low-passed vector of the specific force, with a gate of one and gains that "
        "all stem from before the first axis.",
        since="v1.13",
        until="v1.14",
        source="gravity_fusion.cpp",
    )
    measures_no_gyro_bias: bool = _behaviour(
        "The mean rate at rest is no observation of the gyro's bias.",
        since="v1.13",
        until="v1.14",
        source="control.cpp",
    )
    yields_to_velocity_before_alignment: bool = _behaviour(
        "Zero velocity is not fused beside a vertical velocity, whether or not the tilt is aligned.",
        since="v1.13",
        until="v1.14",
        source="zero_velocity_update.cpp",
    )
    predicts_state_first: bool = _behaviour(
        "The state is predicted before the covariance, which so belongs to the new one and to the new mean interval.",
        since="v1.13",
        until="v1.13",
        source="ekf.cpp",
    )
    takes_bias_increments_off: bool = _behaviour(
        "The increments of the biases are taken off as they are, however long the interval of the sample.",
        since="v1.13",
        until="v1.13",
        source="ekf.cpp",
    )
    learns_gyro_bias_always: bool = _behaviour(
        "The gyro's bias is learnt always, within 20°/s; the accelerometer's unless EKF2_AID_MASK, a manoeuvre, "
        "clipping or a bad acceleration stops it.",
        since="v1.13",
        until="v1.13",
        source="covariance.cpp, ekf_helper.cpp",
    )
    adds_wind_noise_by_update: bool = _behaviour(
        "The wind's noise is EKF2_WIND_NOISE times the interval, whose square is added. v1.14 has a spectral density.",
        since="v1.13",
        until="v1.13",
        source="covariance.cpp",
    )
    updates_by_jacobian: bool = _behaviour(
        "An update takes the gain times the Jacobian times the covariance off, made symmetric, so states whose gain "
        "was zeroed lose half of their covariances with others; the rotation matrix follows the quaternion only at the "
        "next prediction.",
        since="v1.13",
        until="v1.13",
        source="ekf.h, ekf_helper.cpp",
    )
    follows_flags_at_once: bool = _behaviour(
        "What the vehicle's status and the land detector say acts as it arrives, each on its own, and not once the "
        "horizon has come there; only the land detector tells of flying.",
        since="v1.13",
        until="v1.13",
        source="../EKF2.cpp",
    )
    selects_sources_by_mask: bool = _behaviour(
        "EKF2_AID_MASK and EKF2_HGT_MODE say which sources are asked for. v1.14 has a parameter for each.",
        since="v1.13",
        until="v1.13",
        source="common.h",
    )
    starts_with_samples: bool = _behaviour(
        "The filter starts once the buffers could have been filled with samples of the magnetometer, where a heading "
        "is taken from it, and of the barometer; with the heading, and a height that the barometer tells at once.",
        since="v1.13",
        until="v1.13",
        source="ekf.cpp",
    )
    fuses_no_gravity: bool = _behaviour(
        "Gravity is not fused.",
        since="v1.13",
        until="v1.13",
        source="control.cpp",
    )
    resets_to_given_position: bool = _behaviour(
        "A position given from outside while dead reckoning is a reset; a given origin looks the magnetic model up. "
        "v1.16 fuses what agrees, and takes one on the ground, too; v1.14 takes none.",
        since="v1.15",
        until="v1.15",
        source="ekf.cpp, ekf_helper.cpp",
    )
    moves_origin_on_ground_alone: bool = _behaviour(
        "A given origin is taken on the ground alone; without aiding the local position stays what it is.",
        since="v1.13",
        until="v1.13",
        source="ekf_helper.cpp, ../EKF2.cpp",
    )
    knows_no_constant_position: bool = _behaviour(
        "Nothing can tell the filter that the position is constant.",
        since="v1.13",
        until="v1.15",
        source="control.cpp",
    )

    finds_zero_velocity_first: bool = _behaviour(
        "At rest the velocity of all three axes is found before the first is fused.",
        since="v1.13",
        until="v1.14",
        source="zero_velocity_update.cpp",
    )

    # Older releases: GNSS, height, fake aiding and the yaw estimator.

    keeps_yaw_bank_as_matrices: bool = _behaviour(
        "The yaw estimator keeps attitudes as rotation matrices, turned to first order. An innovation beyond 5 σ "
        "weighs in full, though it corrects as one of 5 σ; if all models weigh next to nothing, they start anew.",
        since="v1.13",
        until="v1.15",
        source="yaw_estimator/EKFGSF_yaw.cpp",
    )
    aids_by_one_gnss_flag: bool = _behaviour(
        "GNSS velocity and position start and stop together and count as one source. Where both time out they are "
        "reset after they were fused; both bits of EKF2_GPS_CTRL only say what is taken. v1.16 starts each by itself.",
        since="v1.13",
        until="v1.15",
        source="gps_control.cpp",
    )
    compares_gnss_climb: bool = _behaviour(
        "The check of the vertical speed is of what GNSS and filter differ by, in the air, too; none asks for a limit "
        "of the speed, nor for spoofing.",
        since="v1.13",
        until="v1.15",
        source="gps_checks.cpp",
    )
    waits_half_health_time: bool = _behaviour(
        "A GNSS sample is used once the checks have passed for half of EKF2_REQ_GPS_H. v1.16 waits for a tenth, and "
        "for 1 s at least.",
        since="v1.15",
        until="v1.15",
        source="gps_control.cpp",
    )
    places_origin_by_checks: bool = _behaviour(
        "The first GNSS sample for which the checks have passed gives the origin its place and altitude, before "
        "anything is fused, and a rough fix the magnetic field. v1.16 does so as position and height are reset.",
        since="v1.13",
        until="v1.15",
        source="gps_checks.cpp",
    )
    limits_climb_of_all_rejected: bool = _behaviour(
        "While the vertical acceleration is bad no axis of a velocity is rejected, and the vertical innovation "
        "limited. v1.16 does so where the vertical axis alone fails and GNSS tells a good accuracy.",
        since="v1.13",
        until="v1.15",
        source="velocity_fusion.cpp",
    )
    levers_by_measured_rate: bool = _behaviour(
        "What turns a lever arm is the rate as the gyro measures it, with its bias.",
        since="v1.13",
        until="v1.15",
        source="gps_control.cpp, ekf_helper.cpp",
    )
    resets_height_to_each_source: bool = _behaviour(
        "Where height fails, every source that is fused resets it, keeping its bias, and vertical velocity with it. "
        "v1.16 resets the height to its reference alone.",
        since="v1.14",
        until="v1.15",
        source="baro_height_control.cpp, gnss_height_control.cpp, ev_height_control.cpp",
    )
    starts_at_filtered_baro: bool = _behaviour(
        "The barometer starts as height reference at the low-passed height less the bias that was found meanwhile, so "
        "the height stays near zero, and a fault lasts. v1.16 takes the measurement as altitude.",
        since="v1.14",
        until="v1.15",
        source="baro_height_control.cpp",
    )
    doubts_vertical_acceleration_for_10_s: bool = _behaviour(
        "Vertical acceleration counts as bad for 10 s after it was last found so. v1.16 forgives it after 3 s.",
        since="v1.13",
        until="v1.15",
        source="common.h, height_control.cpp",
    )
    fakes_one_kind_of_position: bool = _behaviour(
        "There is one fake position, which starts by dead reckoning, is fused like any position, and protected from "
        "extremes alone. v1.16 tells one that is valid, at rest, from another.",
        since="v1.13",
        until="v1.15",
        source="fake_pos_control.cpp",
    )
    fakes_position_whenever_unaided: bool = _behaviour(
        "The fake position is used whenever nothing aids, in the air with at least EKF2_GPS_P_NOISE. v1.15 uses it at "
        "rest, and while the tilt is uncertain.",
        since="v1.13",
        until="v1.14",
        source="fake_pos_control.cpp",
    )
    counts_aiding_of_any_kind: bool = _behaviour(
        "GNSS or vision aid while either position or velocity is fused, air data while the wind is estimated; "
        "standing still is no aid.",
        since="v1.13",
        until="v1.15",
        source="ekf_helper.cpp",
    )
    retries_gnss_yaw: bool = _behaviour(
        "A GNSS heading that times out resets the yaw once in flight before it stops as faulty. It starts with a reset "
        "always, and stopping on ground gives the alignment up.",
        since="v1.13",
        until="v1.15",
        source="gps_control.cpp, gps_yaw_fusion.cpp",
    )

    checks_gnss_on_arrival: bool = _behaviour(
        "GNSS is checked, the origin placed, the position projected as a sample arrives. Checks that have not failed "
        "for 5 s let GNSS start, checks that have failed for 5 s stop it beside another source; the yaw is aligned by "
        "the yaw estimator without magnetometer alone. v1.15 does all that when a sample is due.",
        since="v1.13",
        until="v1.14",
        source="estimator_interface.cpp, gps_control.cpp",
    )
    runs_yaw_bank_in_air: bool = _behaviour(
        "The yaw estimator runs in the air alone, from the first velocity on, with the accuracy that GNSS tells as "
        "standard deviation; its yaw follows at every IMU sample. v1.15 lets it run on the ground, too.",
        since="v1.13",
        until="v1.14",
        source="EKFGSF_yaw.cpp",
    )
    aids_gnss_by_mask: bool = _behaviour(
        "EKF2_AID_MASK asks for GNSS and its heading. Horizontal velocity, vertical velocity and position are gated "
        "apart, and judged only where they are fused; soon after take-off 1 s without velocity resets both, a yaw that "
        "is off three times at most. The checks go by the newest IMU sample.",
        since="v1.13",
        until="v1.13",
        source="gps_control.cpp, gps_fusion.cpp, vel_pos_fusion.cpp",
    )
    tells_time_by_newest_imu: bool = _behaviour(
        "What happened when is noted, and asked for, by the time of the newest IMU sample. v1.14 goes by that of the "
        "horizon.",
        since="v1.13",
        until="v1.13",
        source="ekf.h",
    )
    has_one_height_source: bool = _behaviour(
        "One source at a time gives the height: that of EKF2_HGT_MODE, range in its place where EKF2_RNG_AID lets it, "
        "or what replaces one that was lost. The barometer has an offset that follows the others, and a bias by GNSS. "
        "The vertical acceleration is judged by the last height and vertical velocity.",
        since="v1.13",
        until="v1.13",
        source="control.cpp, height_fusion.cpp, baro_bias_estimator.cpp",
    )
    tells_yaw_estimator_height_accuracy: bool = _behaviour(
        "The yaw estimator takes the accuracy of the height for that of the velocity, and for airspeed what was "
        "measured, or EKF2_GSF_TAS without a sample for 1 s; a velocity is fused one update late.",
        since="v1.13",
        until="v1.13",
        source="ekf_helper.cpp",
    )
    fakes_position_at_once: bool = _behaviour(
        "The fake position starts as soon as nothing aids, is told of only where it is fused, and its axes are "
        "protected together.",
        since="v1.13",
        until="v1.13",
        source="fake_pos_control.cpp",
    )

    # Older releases: magnetometer and heading.
    knows_field_of_early_2024: bool = _behaviour(
        "The magnetic model is that of January 2024, in 10⁻⁴ rad and 10⁻⁴ Gauss. v1.16 has that of May 2024.",
        since="v1.15",
        until="v1.15",
        source="../../../lib/world_magnetic_model/geo_magnetic_tables.hpp",
    )
    knows_field_of_2023: bool = _behaviour(
        "The magnetic model is that of April 2023.",
        since="v1.14",
        until="v1.14",
        source="../../../lib/world_magnetic_model/geo_magnetic_tables.hpp",
    )
    knows_field_of_2022: bool = _behaviour(
        "The magnetic model is that of April 2022.",
        since="v1.13",
        until="v1.13",
        source="../../../lib/world_magnetic_model/geo_magnetic_tables.hpp",
    )
    looks_field_up_by_fix: bool = _behaviour(
        "The magnetic model is looked up at GNSS fixes, a rough one is enough, and at a new origin; the declination is "
        "saved once there is an origin. v1.16 looks it up at the estimated position when the field is fused.",
        since="v1.13",
        until="v1.15",
        source="gps_checks.cpp, ekf_helper.cpp",
    )
    assumes_given_declination: bool = _behaviour(
        "Where the magnetic model does not tell the declination, the heading takes EKF2_MAG_DECL, whatever "
        "EKF2_DECL_TYPE says.",
        since="v1.13",
        until="v1.15",
        source="mag_control.cpp",
    )
    limits_declination: bool = _behaviour(
        "After every fusion the declination of the field states is kept within 0.5 rad of the reference, and their "
        "horizontal strength above half of the model's.",
        since="v1.13",
        until="v1.15",
        source="mag_fusion.cpp",
    )
    holds_yaw_observable: bool = _behaviour(
        "GNSS tells the heading above twice EKF2_MAG_ACCLIM, and then for as long as the acceleration is above it. "
        "v1.16 asks for EKF2_MAG_ACCLIM.",
        since="v1.13",
        until="v1.15",
        source="mag_control.cpp",
    )
    counts_field_resets: bool = _behaviour(
        "The field starts anew after any other reset of the yaw, and after two resets in flight is stopped; once its "
        "covariance is new, the declination is fused first. What is not fused is not told; to stop leaves covariance "
        "and yaw alignment as they are. v1.16 resets where nothing else aids, and else stops.",
        since="v1.15",
        until="v1.15",
        source="mag_control.cpp, mag_3d_control.cpp, mag_fusion.cpp",
    )
    follows_newest_turn: bool = _behaviour(
        "How fast the vehicle turns, by which the field is fused or not, is that of the newest IMU samples and not of "
        "those at the horizon.",
        since="v1.13",
        until="v1.13",
        source="ekf.cpp",
    )
    fuses_heading_or_field: bool = _behaviour(
        "The magnetometer fuses the heading, or, once it is aligned in flight and the vehicle accelerates or turns "
        "(EKF2_MAG_YAWLIM), the field, whose states have a covariance only then. The strength alone is checked, within "
        "0.2 Gauss. At rest the yaw at which it came to rest is fused; while levelling it follows the field.",
        since="v1.13",
        until="v1.14",
        source="mag_control.cpp, mag_fusion.cpp, zero_innovation_heading_update.cpp",
    )
    looks_field_up_until_origin: bool = _behaviour(
        "The magnetic model is looked up at every fix until there is an origin, and the first asks for a yaw reset.",
        since="v1.13",
        until="v1.14",
        source="gps_checks.cpp",
    )
    clears_field_whenever_stopped: bool = _behaviour(
        "A magnetometer that may not be used is passed over and a yaw held in its place in every update, not stopped; "
        "the field corrects all states 5 s after it was aligned in flight. A fixed wing's yaw is reset to its course.",
        since="v1.13",
        until="v1.13",
        source="mag_control.cpp, mag_fusion.cpp, ekf_helper.cpp",
    )
    finds_field_first: bool = _behaviour(
        "The innovations of all three axes of the field are found before the first is fused; each is linearised at the "
        "state that the axes before it left.",
        since="v1.13",
        until="v1.13",
        source="mag_fusion.cpp",
    )
    forces_every_yaw: bool = _behaviour(
        "A heading leaves the field states alone, and one that is rejected on the ground is fused all the same every "
        "time. v1.14 does so once a second.",
        since="v1.13",
        until="v1.13",
        source="mag_fusion.cpp",
    )
    observes_yaw_by_vision: bool = _behaviour(
        "The position of vision, too, lets accelerations tell the heading, and needs a yaw indoors.",
        since="v1.13",
        until="v1.13",
        source="mag_control.cpp",
    )
    bounds_declination_innovation: bool = _behaviour(
        "The innovation of the declination is limited to 0.5 rad.",
        since="v1.13",
        until="v1.13",
        source="mag_fusion.cpp",
    )
    puts_body_field_by_yaw_estimator: bool = _behaviour(
        "A reset of the field takes the covariances of both its states, and where the yaw estimator has converged puts "
        "the body field as its yaw wants. v1.16 keeps a field that is near the model's.",
        since="v1.15",
        until="v1.15",
        source="mag_control.cpp",
    )

    # Older releases: range finder, terrain, optical flow, vision, airspeed, drag and sideslip.

    keeps_innovation_at_reset: bool = _behaviour(
        "A reset of the state to a source leaves that source's innovation as it was, and does not count as fused; only "
        "its time-out begins anew.",
        since="v1.13",
        until="v1.15",
        source="ekf_helper.cpp",
    )
    forgets_stopped_sources: bool = _behaviour(
        "A stopped source forgets what it last judged, so that the update that stops it publishes nothing of it.",
        since="v1.14",
        until="v1.15",
        source="ekf.h",
    )
    takes_range_for_height: bool = _behaviour(
        "The range finder is a height source like the barometer, with a bias against the reference and, conditionally, "
        "where the terrain is known. It never corrects the terrain on its way.",
        since="v1.14",
        until="v1.15",
        source="range_height_control.cpp",
    )
    judges_range_in_climb: bool = _behaviour(
        "Whether the range finder agrees with the vertical velocity is concluded only above 0.5 m/s. v1.16 asks for "
        "that only to trust it again.",
        since="v1.14",
        until="v1.15",
        source="range_finder_consistency_check.cpp",
    )
    sees_no_fog: bool = _behaviour(
        "The range finder is not checked for fog; once found faulty it is not used again.",
        since="v1.13",
        until="v1.15",
        source="sensor_range_finder.cpp",
    )
    flies_flow_over_terrain: bool = _behaviour(
        "Flow of sufficient quality, within the sensor's rate and level enough, is fused over the terrain that the "
        "filter apart knows, whose distance is taken as given. The sensor's gyro is taken as it is for the flow, its "
        "bias for the lever arm alone; the velocity is reset to the single sample.",
        since="v1.13",
        until="v1.15",
        source="optical_flow_control.cpp, optflow_fusion.cpp",
    )
    turns_vision_velocity: bool = _behaviour(
        "Velocity of vision is fused along north, east and down, of whatever frame it is; beside GNSS its variance is "
        "at least that of EKF2_GPS_V_NOISE. It starts beside another source only well within its gate. v1.16 fuses "
        "velocities of the body in their frame.",
        since="v1.13",
        until="v1.15",
        source="ev_vel_control.cpp",
    )
    starts_vision_yaw_unjudged: bool = _behaviour(
        "The yaw of vision is judged only where it is fused, and starts without being fused.",
        since="v1.13",
        until="v1.15",
        source="ev_yaw_control.cpp",
    )
    rounds_vision_filter: bool = _behaviour(
        "The rotation of vision is filtered with a gain of 0.001. v1.16 takes the one of 10 ms and 10 s.",
        since="v1.13",
        until="v1.15",
        source="ekf.h",
    )
    asks_airspeed_for_wings: bool = _behaviour(
        "Airspeed and sideslip are fused on a fixed wing alone; airspeed that corrects every state does not count as "
        "horizontal velocity.",
        since="v1.13",
        until="v1.15",
        source="airspeed_fusion.cpp, sideslip_fusion.cpp",
    )
    starts_wind_at_zero: bool = _behaviour(
        "Sideslip and drag start with a wind of zero; sideslip before it is fused, whether or not it is then accepted.",
        since="v1.13",
        until="v1.15",
        source="sideslip_fusion.cpp, drag_fusion.cpp",
    )
    takes_sideslip_for_ratio: bool = _behaviour(
        "Sideslip is the ratio of sideways to forward air velocity, not its angle; EKF2_BETA_NOISE has no lower bound.",
        since="v1.13",
        until="v1.15",
        source="sideslip_fusion.cpp",
    )
    fuses_both_drag_axes: bool = _behaviour(
        "Drag counts as fused where both axes were.",
        since="v1.13",
        until="v1.15",
        source="drag_fusion.cpp",
    )
    sees_terrain_in_air: bool = _behaviour(
        "The range finder corrects the terrain in the air alone and starts with its distance; on the ground the "
        "terrain is right below whatever is measured, so that nothing is to be reset at take-off.",
        since="v1.13",
        until="v1.14",
        source="terrain_estimator.cpp",
    )
    keeps_terrain_known: bool = _behaviour(
        "The terrain counts as known for 5 s after a sensor, or standing on the ground, has told of it, whether or not "
        "that goes on; flow corrects it along each axis by itself.",
        since="v1.13",
        until="v1.13",
        source="terrain_estimator.cpp",
    )
    leaves_terrain_at_height_resets: bool = _behaviour(
        "A reset of the height does not move the terrain.",
        since="v1.13",
        until="v1.14",
        source="ekf_helper.cpp",
    )
    integrates_flow: bool = _behaviour(
        "Flow and its gyro are integrals, whose interval is held against the time in which the IMU was summed up; on "
        "the ground bad flow counts as none and motion must be calm; without range for 10 s it waits. A start or a "
        "reset of the velocity takes the last known position along.",
        since="v1.13",
        until="v1.14",
        source="optical_flow_control.cpp, optflow_fusion.cpp",
    )
    takes_vision_rotation_unfiltered: bool = _behaviour(
        "The rotation from the frame of vision to NED is that of the sample.",
        since="v1.14",
        until="v1.14",
        source="ev_pos_control.cpp, ev_vel_control.cpp, ev_height_control.cpp",
    )
    follows_vision_height_by_sample: bool = _behaviour(
        "The height bias of vision is predicted at its samples alone, over one update.",
        since="v1.14",
        until="v1.14",
        source="ev_height_control.cpp",
    )
    gives_north_up_for_vision: bool = _behaviour(
        "The yaw of vision in its own frame stops GNSS and magnetometer as it starts; GNSS that starts in its place "
        "holds it back until it stops.",
        since="v1.14",
        until="v1.14",
        source="ev_yaw_control.cpp, gps_control.cpp",
    )
    starts_airspeed_by_wind: bool = _behaviour(
        "Airspeed that starts never sets the velocity, only a wind that is not known or whose variances add up to more "
        "than 1 m²/s²; that is given those of a heading known to 10°.",
        since="v1.13",
        until="v1.14",
        source="airspeed_fusion.cpp",
    )
    slips_at_speed: bool = _behaviour(
        "Sideslip is fused above 7 m/s through the air.",
        since="v1.13",
        until="v1.14",
        source="sideslip_fusion.cpp",
    )
    feels_drag_in_air: bool = _behaviour(
        "Drag is judged in the air alone, the first time from a sample that came on the ground. It corrects the wind "
        "alone, and is not told of.",
        since="v1.13",
        until="v1.14",
        source="drag_fusion.cpp",
    )
    averages_clipped_drag: bool = _behaviour(
        "Clipped acceleration is averaged into that of drag.",
        since="v1.13",
        until="v1.14",
        source="estimator_interface.cpp",
    )
    compares_range_in_slow_flight: bool = _behaviour(
        "The range finder is held against the vertical velocity only where a multicopter does not move horizontally; "
        "on the ground it says what it says, unless it leads.",
        since="v1.13",
        until="v1.13",
        source="control.cpp",
    )
    fuses_flow_at_once: bool = _behaviour(
        "Flow is judged where it is fused, both axes from the covariance of before, and from its start on; the bias of "
        "its gyro is put on the flow. It waits for a heading. The velocity is reset by the range finder's tilt.",
        since="v1.13",
        until="v1.13",
        source="control.cpp, optflow_fusion.cpp",
    )
    fuses_vision_by_mask: bool = _behaviour(
        "EKF2_AID_MASK says what of vision is fused, and whether it is turned; beside GNSS steps of its position. "
        "Nothing counts its resets or asks for its quality, and its velocity is as certain as it says.",
        since="v1.13",
        until="v1.13",
        source="control.cpp, ekf_helper.cpp",
    )
    judges_air_data_when_fused: bool = _behaviour(
        "Airspeed and sideslip are judged only where they are fused: the one above 1 m/s, and started whatever it "
        "says, the other above 7 m/s in all directions, from the first status of the vehicle in the air on.",
        since="v1.13",
        until="v1.13",
        source="airspeed_fusion.cpp, sideslip_fusion.cpp, control.cpp",
    )
    averages_last_drag: bool = _behaviour(
        "Drag is averaged over the last raw sample of each interval of the filter, and not over all.",
        since="v1.13",
        until="v1.13",
        source="estimator_interface.cpp",
    )
    linearises_drag_by_force: bool = _behaviour(
        "Drag is linear in the air along its axis, as steep as at the speed for which the model has the measured "
        "force. It waits while the magnetometer could not be used for so long that the yaw is to be reset.",
        since="v1.13",
        until="v1.13",
        source="drag_fusion.cpp",
    )


def _behaviours_of(release: str) -> Behaviours:
    place = RELEASES.index(release)
    had = {
        one.name: RELEASES.index(one.metadata["since"]) <= place <= RELEASES.index(one.metadata["until"])
        for one in fields(Behaviours)
    }
    return Behaviours(**had)


BEHAVIOURS: Mapping[str, Behaviours] = MappingProxyType({release: _behaviours_of(release) for release in RELEASES})
"""What each release does; all of v1.16's are false."""

MODELLED = RELEASES
"""Releases all of whose behaviours are here; the others are not replayed."""
