"""Each figure against a calculation by hand from the raw topics of a real log, none of it with the project's code.

Where PX4's `process_logdata_ekf` defines the figure rightly, the hand calculation is that definition; where it does
not, the test says so.
"""

from __future__ import annotations

import numpy as np
import pytest

SKYRATS = "SkyRats__log_8"  # v1.12: vibration per interval, biases per update
FAULTY = "SkyRats__log_29"  # v1.11: no estimator_status_flags
BETA = "PX4__ekf_failure"  # v1.15: aid sources, biases as rates
SWITCHING = "Chainplain"  # v1.13: four estimator instances
OCTOROTOR = "FSYR-H"  # v1.14

RATIOS = {
    "status_velocity": ("vel_test_ratio", 0.0),
    "status_position": ("pos_test_ratio", 0.0),
    "status_height": ("hgt_test_ratio", 5.0),
    "status_heading": ("mag_test_ratio", 5.0),
}
"""PX4 cuts five seconds at both ends of a flight for height and heading."""


@pytest.mark.parametrize("name", [SKYRATS, FAULTY, SWITCHING])
@pytest.mark.parametrize("subject", RATIOS)
def test_ratios_of_the_status_are_those_of_px4s_scripts(told, name, subject):
    """`calculate_sensor_metrics`: shares of rows above 1 and, less those, above 0.5; maximum and mean."""
    health = told(name)
    field, margin = RATIOS[subject]
    ratio = health.raw.in_flight("estimator_status", field, margin_s=margin)
    red = np.mean(ratio > 1.0)
    assert health.figure(f"{subject}.red_share", 0) == pytest.approx(red, abs=1e-12)
    assert health.figure(f"{subject}.amber_share", 0) == pytest.approx(np.mean(ratio > 0.5) - red, abs=1e-12)
    assert health.figure(f"{subject}.max_ratio", 0) == pytest.approx(ratio.max())
    assert health.figure(f"{subject}.mean_ratio", 0) == pytest.approx(ratio.mean())
    # PX4 judges the amber share, so that a flight with all beyond 1 passes; we judge both together
    assert health.figure(f"{subject}.raised_share", 0) == pytest.approx(np.mean(ratio > 0.5), abs=1e-12)


def test_worst_half_minute_is_the_largest_mean_of_any_thirty_seconds(told):
    health = told(SKYRATS)
    table = health.raw.topic("estimator_status")
    rows = health.raw.flying(table["timestamp"])
    time, ratio = table["timestamp"][rows] * 1e-6, table["vel_test_ratio"][rows].astype(np.float64)
    starts = [one for one in time if one + 30.0 <= health.raw.flights[0][1] * 1e-6]
    means = [ratio[(time >= one) & (time < one + 30.0)].mean() for one in starts]
    row = health.row("status_velocity.worst_ratio")
    assert row.finding.figure == pytest.approx(max(means))
    assert row.finding.start_us == pytest.approx(starts[int(np.argmax(means))] * 1e6)
    assert row.finding.stop_us - row.finding.start_us == 30_000_000


def test_ratios_of_an_aid_source_are_unfiltered_and_by_direction(told):
    """`estimator_aid_src_gnss_vel` of v1.15 has a ratio of each axis; PX4's scripts have none of these figures."""
    health = told(BETA)
    table = health.raw.topic("estimator_aid_src_gnss_vel")
    rows = health.raw.flying(table["timestamp_sample"])
    axes = np.column_stack([table[f"test_ratio[{axis}]"][rows] for axis in range(3)]).astype(np.float64)
    for group, ratio in (("horizontal", axes[:, :2].max(axis=1)), ("vertical", axes[:, 2])):
        subject = f"gnss_vel_{group}"
        assert health.figure(f"{subject}.raised_share") == pytest.approx(np.mean(ratio > 0.5))
        assert health.figure(f"{subject}.red_share") == pytest.approx(np.mean(ratio > 1.0))
        assert health.figure(f"{subject}.mean_ratio") == pytest.approx(ratio.mean())
        assert health.figure(f"{subject}.max_ratio") == pytest.approx(ratio.max())
        rejected = (table["innovation_rejected"][rows] > 0) & (ratio > 1.0)
        assert health.figure(f"{subject}.rejected_share") == pytest.approx(np.mean(rejected))
    assert health.figure("gnss_vel_vertical.rejected_share") > health.figure("gnss_vel_horizontal.rejected_share")
    assert "unfiltered" not in health.row("status_velocity.mean_ratio").finding.evidence["ratio"]


@pytest.mark.parametrize("instance", [1, 2, 3])
def test_instances_whose_innovations_were_thinned_apart_have_the_ratios_that_they_logged(told, instance):
    """`estimator_innovation_test_ratios`, while GNSS is fused: each time that any of its values is a new one."""
    health = told(SWITCHING)
    table, flags = (health.raw.topic(f"estimator_{name}", instance) for name in ("innovation_test_ratios", "status"))
    values = np.column_stack([table["gps_hvel[0]"], table["gps_hvel[1]"], table["gps_vvel"]])
    before = np.maximum(np.searchsorted(flags["timestamp"], table["timestamp"], side="right") - 1, 0)
    rows = (flags["control_mode_flags"][before] >> 2 & 1).astype(bool) & health.raw.flying(table["timestamp_sample"])
    rows &= np.r_[True, np.any(np.diff(values, axis=0) != 0, axis=1)] & np.any(values > 0, axis=1)
    vertical = values[rows, 2].astype(np.float64)
    assert len(vertical) > 60
    assert health.figure("gnss_vel_vertical.raised_share", instance) == pytest.approx(np.mean(vertical > 0.5))
    assert health.figure("gnss_vel_vertical.mean_ratio", instance) == pytest.approx(vertical.mean())
    horizontal = values[rows, :2].max(axis=1)
    assert health.figure("gnss_vel_horizontal.red_share", instance) == pytest.approx(np.mean(horizontal > 1.0))
    assert "estimator_innovation_test_ratios" in health.row("mag.mean_ratio", instance).finding.evidence["ratio"]


def test_a_magnetometer_that_one_instance_gave_up_was_not_fused_from_then_on(told):
    health = told(SWITCHING)
    flags = health.raw.topic("estimator_status_flags", 2)
    given_up = flags["timestamp"][np.argmax(flags["cs_mag_fault"] > 0)]
    row = health.row("mag.longest_unfused_s", 2).finding
    assert row.figure == pytest.approx((health.raw.flights[-1][1] - given_up) * 1e-6, abs=0.6)
    assert row.severity == "warning"


def test_time_without_fusion_is_what_the_filter_says_of_its_last_one(told):
    health = told(BETA)
    table = health.raw.topic("estimator_aid_src_gnss_pos")
    rows = health.raw.flying(table["timestamp_sample"]) & (table["time_last_fuse"] > 0)
    without = (table["timestamp_sample"][rows] - table["time_last_fuse"][rows].astype(np.int64)) * 1e-6
    assert health.figure("gnss_pos.longest_unfused_s") == pytest.approx(without.max())
    assert health.row("gnss_pos.longest_unfused_s").finding.severity == "warning"


def test_the_magnetometer_has_its_own_ratios_not_those_of_the_heading(told):
    """PX4's scripts call `hdg_test_ratio` that of the magnetometer."""
    health = told(BETA)
    table = health.raw.topic("estimator_aid_src_mag")
    rows = health.raw.flying(table["timestamp_sample"], margin_s=5.0)
    ratio = np.max([table[f"test_ratio[{axis}]"][rows] for axis in range(3)], axis=0)
    assert health.figure("mag.mean_ratio") == pytest.approx(ratio.mean(dtype=np.float64))
    assert health.figure("mag.mean_ratio") != pytest.approx(health.figure("status_heading.mean_ratio"), rel=0.1)


@pytest.mark.parametrize("instance", [0, 1, 2, 3])
def test_rejections_of_each_instance_and_direction_stand_apart(told, instance):
    """PX4's scripts write vertical velocity over horizontal, read instance 0, and count rows, not time."""
    health = told(SWITCHING)
    for name, field, margin in (
        ("hor_vel", "reject_hor_vel", 0.0),
        ("ver_vel", "reject_ver_vel", 0.0),
        ("hor_pos", "reject_hor_pos", 0.0),
        ("ver_pos", "reject_ver_pos", 5.0),
        ("mag_y", "reject_mag_y", 5.0),
    ):
        share = health.raw.share_of_time("estimator_status_flags", field, instance, margin)
        assert health.figure(f"rejections.{name}_share", instance) == pytest.approx(share, abs=1e-4)


def test_rejections_before_there_were_flags_are_bits(told):
    """`innovation_check_flags` of v1.11: bit 0 horizontal velocity, bit 2 horizontal position, bit 7 heading."""
    health = told(FAULTY)
    status = health.raw.topic("estimator_status")
    for name, bit, margin in (("hor_vel", 0, 0.0), ("hor_pos", 2, 0.0), ("yaw", 7, 5.0)):
        status["bit"] = status["innovation_check_flags"] >> bit & 1
        share = health.raw.share_of_time("estimator_status", "bit", 0, margin)
        assert share > 0.04
        assert health.figure(f"rejections.{name}_share") == pytest.approx(share, abs=1e-4)


@pytest.mark.parametrize("name", [SKYRATS, FAULTY, BETA])
def test_output_predictor_errors_are_those_of_px4s_scripts(told, name):
    """`calculate_imu_metrics`: medians, five seconds after take-off to five before landing."""
    health = told(name)
    for axis, figure in enumerate(("angle_error_rad", "velocity_error_m_s", "position_error_m")):
        values = health.raw.in_flight("estimator_status", f"output_tracking_error[{axis}]", margin_s=5.0)
        assert health.figure(f"output_predictor.{figure}") == pytest.approx(np.median(values))


def test_vibration_per_interval_becomes_rates(told):
    """v1.12 logs rad and m/s per IMU interval, which PX4's scripts hold against limits a thousand times as large."""
    health = told(SKYRATS)
    interval = np.median(health.raw.topic("vehicle_imu")["delta_angle_dt"]) * 1e-6
    for name, field, by in (
        ("accel", "accel_vibration_metric", interval),
        ("gyro", "gyro_vibration_metric", interval),
        ("coning", "gyro_coning_vibration", 1.0),
    ):
        values = health.raw.in_flight("vehicle_imu_status", field, margin_s=5.0) / by
        assert health.figure(f"vibration.{name}_mean") == pytest.approx(values.mean(), rel=1e-6)
        assert health.figure(f"vibration.{name}_peak") == pytest.approx(values.max(), rel=1e-6)
    # a vehicle whose vibration is as usual for its size
    assert 5.0 < health.figure("vibration.accel_mean") < 15.0


def test_vibration_of_later_releases_is_taken_as_it_is(told):
    """PX4's scripts look for `gyro_coning_vibration`, which v1.13 renamed, and then tell nothing at all."""
    health = told(OCTOROTOR)
    for imu in range(3):
        values = health.raw.in_flight("vehicle_imu_status", "gyro_vibration_metric", imu, 5.0)
        assert health.figure("vibration.gyro_mean", imu) == pytest.approx(values.mean(), rel=1e-6)
    # "strong vibration" in the logs' list
    assert health.row("vibration.gyro_mean", 0).finding.severity == "warning"


def test_clipping_is_what_the_counters_grew_by_clear_of_the_ground(told):
    health = told(BETA)
    for imu in range(2):
        table = health.raw.topic("vehicle_imu_status", imu)
        clear = health.raw.flying(table["timestamp"], margin_s=5.0)
        # two flights: the counter at the last row of each less that at its first
        pieces = np.split(np.flatnonzero(clear), np.flatnonzero(np.diff(np.flatnonzero(clear)) > 1) + 1)
        counters = sum(table[f"accel_clipping[{axis}]"].astype(int) for axis in range(3))
        grown = sum(counters[piece[-1]] - counters[piece[0]] for piece in pieces)
        assert health.figure("clipping.accel", imu) == grown
        assert health.row("clipping.accel", imu).finding.severity == "fail"


@pytest.mark.parametrize(("name", "instance"), [(SKYRATS, 0), (SWITCHING, 0), (SWITCHING, 2), ("Parham", 0)])
def test_biases_per_update_become_rates_by_the_logs_own_interval(told, name, instance):
    """PX4's scripts take the states as they are: increments up to v1.14, of 8 to 10.5 ms by the IMU's rate.

    `estimator_sensor_bias` tells the same biases as rates; by hand the update interval is a whole number of IMU
    intervals next to 10 ms.
    """
    health = told(name)
    medians = [
        np.median(health.raw.in_flight("estimator_states", f"states[{state}]", instance, 5.0))
        for state in range(10, 16)
    ]
    imu = np.median(health.raw.topic("sensor_combined")["gyro_integral_dt"]) * 1e-6
    interval = round(0.01 / imu) * imu
    assert health.figure("bias.gyro", instance) == pytest.approx(np.linalg.norm(medians[:3]) / interval, rel=0.01)
    assert health.figure("bias.accel", instance) == pytest.approx(np.linalg.norm(medians[3:]) / interval, rel=0.01)
    span = [np.ptp(health.raw.in_flight("estimator_states", f"states[{one}]", instance)) for one in range(10, 13)]
    assert health.figure("bias.gyro_change", instance) == pytest.approx(np.linalg.norm(span) / interval, rel=0.01)


def test_biases_that_are_rates_stay_as_they_are(told):
    health = told(BETA)
    for name, states in (("gyro", range(10, 13)), ("accel", range(13, 16))):
        medians = [
            np.median(health.raw.in_flight("estimator_states", f"states[{state}]", margin_s=5.0)) for state in states
        ]
        assert health.figure(f"bias.{name}") == pytest.approx(np.linalg.norm(medians), rel=1e-6)


def test_faults_are_those_of_the_status_by_name_and_time(told):
    """`filter_faults_max` of PX4's scripts; v1.15 has bad vertical acceleration at bit 10."""
    health = told(BETA)
    status = health.raw.topic("estimator_status")
    row = health.row("filter.faults").finding
    assert row.figure == status["filter_fault_flags"].max() == 1 << 10
    assert row.severity == "fail"
    assert list(row.evidence) == ["fs_bad_acc_vertical"]
    when = status["timestamp"][status["filter_fault_flags"] > 0]
    assert row.start_us <= when[0] <= when[-1] < row.stop_us


def test_resets_of_each_instance_by_its_own_counter(told):
    health = told(SWITCHING)
    for instance in range(4):
        status = health.raw.topic("estimator_status", instance)
        clear = health.raw.flying(status["timestamp"], margin_s=5.0)
        steps = np.diff(status["reset_count_pod_d"].astype(int))
        assert health.figure("resets.height", instance) == steps[clear[1:]].sum()


def test_alignment_and_flight_times(told):
    health = told(BETA)
    flags, log = health.raw.topic("estimator_status_flags"), health.raw.log
    for kind in ("tilt", "yaw"):
        first = flags["timestamp"][np.argmax(flags[f"cs_{kind}_align"] > 0)]
        expected = max(first.astype(np.int64) - log.start_timestamp, 0) * 1e-6
        assert health.figure(f"alignment.{kind}_s") == pytest.approx(expected)
    (start, _), (_, stop) = health.raw.flights[0], health.raw.flights[-1]
    assert health.figure("flight.take_off_s") == pytest.approx((start - log.start_timestamp) * 1e-6)
    assert health.figure("flight.landing_s") == pytest.approx((stop - log.start_timestamp) * 1e-6)
    seconds = sum(stop - start for start, stop in health.raw.flights) * 1e-6
    assert health.figure("flight.airborne_s") == pytest.approx(seconds)


def test_gnss_quality_against_the_minima_of_the_log(told):
    health = told(SKYRATS)
    parameters = health.raw.log.initial_parameters
    for name, field, parameter in (
        ("eph", "eph", "EKF2_REQ_EPH"),
        ("epv", "epv", "EKF2_REQ_EPV"),
        ("speed_accuracy", "s_variance_m_s", "EKF2_REQ_SACC"),
    ):
        values = np.sort(health.raw.in_flight("vehicle_gps_position", field))
        row = health.row(f"gnss.{name}").finding
        # the smallest value that at least 95 % of the samples do not exceed
        assert row.figure == values[int(np.ceil(0.95 * (len(values) - 1)))]
        assert row.threshold == pytest.approx(parameters[parameter])
        assert row.evidence["median"] == pytest.approx(np.median(values))
        assert row.evidence["worst"] == values[-1]
    satellites = np.sort(health.raw.in_flight("vehicle_gps_position", "satellites_used"))
    assert health.figure("gnss.satellites") == satellites[int(0.05 * (len(satellites) - 1))]
    dilution = np.hypot(*(health.raw.in_flight("vehicle_gps_position", one) for one in ("hdop", "vdop")))
    assert health.row("gnss.pdop").finding.evidence["median"] == pytest.approx(np.median(dilution))


def test_gnss_that_never_has_a_fix_fails_where_it_should_be_used(told):
    fails = told("Auterion__quadrotor_local")
    assert fails.row("gnss.fix_type").finding.severity == "fail"
    off = told("PX4__gps_interference")
    assert off.raw.log.initial_parameters["EKF2_GPS_CTRL"] == 0
    assert not off.ids("fail")


def test_rates_by_integration_time_and_by_what_the_estimator_took(told):
    complete, thinned = told("JAParedes"), told(SKYRATS)
    integral = complete.raw.topic("sensor_combined")["gyro_integral_dt"]
    assert complete.figure("imu.rate_hz") == pytest.approx(1e6 / np.median(integral))
    # each update names the magnetometer sample that it took, ms / 10 after its own time
    updates = complete.raw.topic("ekf2_timestamps")
    relative = updates["vehicle_magnetometer_timestamp_rel"]
    taken = relative != 0x7FFF
    times = np.unique(updates["timestamp"][taken].astype(np.int64) // 100 + relative[taken])
    assert complete.figure("mag.rate_hz") == pytest.approx(1e4 / np.median(np.diff(times)), rel=0.02)
    # two samples a second are what the logger left of them
    assert thinned.row("mag.rate_hz").finding.severity == "does-not-apply"


def test_gaps_in_flight(told):
    health = told("mengchaoheng")
    ((start, stop),) = health.raw.flights
    time = health.raw.topic("sensor_combined")["timestamp"].astype(np.int64)
    gaps = np.diff(np.r_[start, time[(time >= start) & (time < stop)], stop])
    assert health.figure("imu.longest_gap_s") == pytest.approx(gaps.max() * 1e-6)
    assert health.row("imu.longest_gap_s").finding.severity == "warning"


def test_changes_of_the_primary_instance(told):
    health = told(SWITCHING)
    selector = health.raw.topic("estimator_selector_status")
    changed = np.flatnonzero(np.diff(selector["primary_instance"].astype(int))) + 1
    times = selector["timestamp"][changed]
    flying = times[health.raw.flying(times)]
    assert health.figure("instances.switches") == len(flying) > 0
    most = max(np.sum((flying >= one) & (flying < one + 10_000_000)) for one in flying)
    assert health.figure("instances.whipsaw") == most
    held = np.diff(np.r_[selector["timestamp"], health.raw.log.last_timestamp].astype(np.int64))
    share = held[selector["primary_instance"] == 0].sum() / held.sum()
    assert health.figure("instances.primary_share", 0) == pytest.approx(share)
