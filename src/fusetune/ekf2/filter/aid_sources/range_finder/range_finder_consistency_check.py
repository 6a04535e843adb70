"""Does the distance to ground change as the estimated vertical velocity says?

The difference quotient of the distance is compared with the velocity; the signed test ratio, low-passed over 2 s, makes
a lasting disagreement show even where every single one is small. Over uneven ground the distance changes without
vertical motion, so nothing is concluded while the vehicle moves horizontally.

Mirrors PX4 v1.16 `EKF/aid_sources/range_finder/range_finder_consistency_check.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel

SIGNED_TEST_RATIO_TAU = 2.0
MIN_VZ_FOR_VALID_CONSISTENCY = 0.5
CONSISTENCY_HYST_TIME = 1_000_000
DT_MIN_S, DT_MAX_S = 0.001, 0.5
MISTAKEN_MOTION_HOLD, MOTION_HOLD = 2, 2_000_000
"""PX4 v1.16 compares its time constant of 2 (s) with microseconds, so motion counts for 2 µs only: for this sample."""


@kernel
def update_range_consistency(
    rng, distance, distance_variance, vz, vz_variance, horizontal_motion, hold_us, time_us, gate
):
    """Take in one distance to ground (m, up from ground) with the velocity estimate of its time (m/s, down).

    For `hold_us` after horizontal motion no inconsistency is concluded.
    """
    if horizontal_motion:
        rng.kin_time_last_horizontal_motion = time_us

    dt = (time_us - rng.kin_time_last_update) * 1e-6
    if rng.kin_time_last_update != 0 and DT_MIN_S <= dt <= DT_MAX_S:
        rng.kin_innovation = -(distance - rng.kin_dist_bottom_prev) / dt - vz
        rng.kin_innovation_variance = 2.0 * distance_variance / (dt * dt) + vz_variance
        innovation_squared = rng.kin_innovation * rng.kin_innovation
        rng.kin_test_ratio = innovation_squared / rng.kin_innovation_variance / (gate * gate)
        signed_test_ratio = rng.kin_test_ratio if rng.kin_innovation > 0.0 else -rng.kin_test_ratio
        alpha = dt / (dt + SIGNED_TEST_RATIO_TAU)
        rng.kin_signed_test_ratio_lpf += alpha * (signed_test_ratio - rng.kin_signed_test_ratio_lpf)
        _judge_consistency(rng, vz, hold_us, time_us)

    rng.kin_time_last_update = time_us
    rng.kin_dist_bottom_prev = distance


@kernel
def _judge_consistency(rng, vz, hold_us, time_us):
    """Inconsistent when the filtered ratio fails; consistent again only while climbing or descending shows it."""
    if abs(rng.kin_signed_test_ratio_lpf) >= 1.0:
        if time_us - rng.kin_time_last_horizontal_motion > hold_us:
            rng.is_kinematically_consistent = False
            rng.kin_time_last_inconsistent = time_us
    elif (
        abs(vz) > MIN_VZ_FOR_VALID_CONSISTENCY
        and rng.kin_test_ratio < 1.0
        and time_us - rng.kin_time_last_inconsistent > CONSISTENCY_HYST_TIME
    ):
        rng.is_kinematically_consistent = True
