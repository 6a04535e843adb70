"""Expected values: the thresholds themselves, a filter computed by hand, and the drift figures that PX4 logged."""

import math

import numpy as np
import pytest

from fusetune.ekf2.feed.sensor_samples import GNSS_SAMPLE
from fusetune.ekf2.filter.aid_sources.gnss.gnss_checks import check_gnss_sample, run_gnss_checks
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import GNSS_MEMORY, initialise_gnss_memory
from fusetune.ekf2.filter.common.control_status import CONTROL_STATUS, INFORMATION_EVENTS

EKF = np.dtype(
    [("time_delayed_us", "i8"), ("cs", CONTROL_STATUS), ("events", INFORMATION_EVENTS), ("gnss", GNSS_MEMORY)],
    align=True,
)
LIMITS = {
    "EKF2_GPS_CHECK": 1023.0,
    "EKF2_REQ_GPS_H": 10.0,
    "EKF2_REQ_NSATS": 6.0,
    "EKF2_REQ_PDOP": 2.5,
    "EKF2_REQ_EPH": 3.0,
    "EKF2_REQ_EPV": 5.0,
    "EKF2_REQ_SACC": 0.5,
    "EKF2_REQ_HDRIFT": 0.1,
    "EKF2_REQ_VDRIFT": 0.2,
    "EKF2_VEL_LIM": 100.0,
}
START_US = 10_000_000


def parameters(**changed):
    record = np.zeros(1, [(name, "f8") for name in LIMITS])[0]
    for name, value in {**LIMITS, **changed}.items():
        record[name] = value
    return record


@pytest.fixture
def ekf():
    record = np.zeros(1, EKF)[0]
    initialise_gnss_memory(record["gnss"])
    record["cs"]["vehicle_at_rest"] = True
    return record


@pytest.fixture
def sample():
    record = np.zeros(1, GNSS_SAMPLE)[0]
    record["lat_deg"], record["lon_deg"], record["alt"] = 47.4, 8.5, 488.0
    record["fix_type"], record["nsats"] = 3, 10
    record["hacc"], record["vacc"], record["sacc"], record["pdop"] = 1.0, 1.5, 0.2, 1.2
    return record


def run_for(ekf, params, sample, seconds, interval=0.2):
    results = []
    for step in range(round(seconds / interval)):
        time_us = START_US + round(step * interval * 1e6)
        sample["time_us"] = time_us
        ekf["time_delayed_us"] = time_us
        results.append((time_us, bool(check_gnss_sample(ekf, params, sample)), bool(ekf["gnss"]["checks_passed"])))
    return results


def test_a_good_receiver_is_used_after_a_second_and_trusted_after_ten(ekf, sample):
    results = run_for(ekf, parameters(), sample, 12.0)
    # the first sample counts as a failure, and the time must have been exceeded
    first_used = next(time for time, used, _ in results if used)
    first_trusted = next(time for time, _, trusted in results if trusted)
    assert first_used == START_US + 1_200_000
    assert first_trusted == START_US + 10_200_000
    assert ekf["events"]["gps_checks_passed"]


@pytest.mark.parametrize(
    ("field", "value", "flag", "bit"),
    [
        ("nsats", 5, "nsats", 0),
        ("pdop", 2.6, "pdop", 1),
        ("hacc", 3.1, "hacc", 2),
        ("vacc", 5.1, "vacc", 3),
        ("sacc", 0.6, "sacc", 4),
        ("spoofed", True, "spoofed", 9),
    ],
)
def test_a_limit_fails_the_sample_only_if_its_bit_is_set(ekf, sample, field, value, flag, bit):
    sample[field] = value
    assert not run_gnss_checks(ekf, parameters(), sample)
    assert ekf["gnss"]["fail"][flag]
    assert run_gnss_checks(ekf, parameters(EKF2_GPS_CHECK=float(1023 & ~(1 << bit))), sample)


def test_a_fix_is_required_whatever_the_bits(ekf, sample):
    sample["fix_type"] = 2
    assert not run_gnss_checks(ekf, parameters(EKF2_GPS_CHECK=0.0), sample)


def test_drift_is_low_passed_with_ten_seconds(ekf, sample):
    params = parameters()
    sample["time_us"] = START_US
    run_gnss_checks(ekf, params, sample)
    # 1 m north in 1 s is 1 m/s, the limit of ten times the threshold, of which a tenth enters
    sample["time_us"] += 1_000_000
    sample["lat_deg"] += math.degrees(1.0 / 6371000.0)
    sample["alt"] += 0.5
    sample["vel"][:] = (0.0, 0.4, 0.1)
    run_gnss_checks(ekf, params, sample)
    assert ekf["gnss"]["horizontal_position_drift_rate"] == pytest.approx(0.1, abs=1e-6)
    assert ekf["gnss"]["vertical_position_drift_rate"] == pytest.approx(0.05)
    assert ekf["gnss"]["filtered_horizontal_velocity"] == pytest.approx(0.04)
    assert ekf["gnss"]["vel_d_filt"] == pytest.approx(0.01)


def test_flying_clears_drift_failures_and_moving_on_ground_keeps_them(ekf, sample):
    params = parameters()
    ekf["gnss"]["fail"]["hdrift"] = True
    ekf["cs"]["vehicle_at_rest"] = False
    run_gnss_checks(ekf, params, sample)
    assert ekf["gnss"]["fail"]["hdrift"]
    assert math.isnan(ekf["gnss"]["horizontal_position_drift_rate"])
    ekf["cs"]["in_air"] = True
    run_gnss_checks(ekf, params, sample)
    assert not ekf["gnss"]["fail"]["hdrift"]


def test_nothing_flies_faster_than_the_velocity_limit(ekf, sample):
    ekf["cs"]["in_air"] = True
    sample["vel"][0] = 101.0
    assert not run_gnss_checks(ekf, parameters(), sample)
    assert run_gnss_checks(ekf, parameters(EKF2_VEL_LIM=200.0), sample)
