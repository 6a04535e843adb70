"""What a log lacks for a closer replay."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fusetune.analyze.reconstruction.between_samples import logged_rate_hz
from fusetune.analyze.trust.words import other_release
from fusetune.check import Check
from fusetune.finding import Finding
from fusetune.px4.estimator_samples import is_complete, logged_share
from fusetune.px4.flight import Flight
from fusetune.px4.logger_settings import (
    ESTIMATOR_REPLAY_BIT,
    SET_LOG_EVERY_SAMPLE,
    SET_LOG_FROM_BOOT,
    logging_profile_of,
    logs_from_boot,
)
from fusetune.save.checks.barometer import barometer
from fusetune.save.checks.flight import log_start
from fusetune.save.checks.gnss import gnss
from fusetune.save.checks.imu import imu_coverage
from fusetune.save.checks.judged_flight import JudgedFlight
from fusetune.save.checks.log import firmware
from fusetune.save.checks.magnetometer import magnetometer
from fusetune.save.replayed_release import ReplayedRelease

FULL_MAG_RATE_HZ, FULL_BARO_RATE_HZ, FULL_GNSS_RATE_HZ = 20.0, 10.0, 4.5
FULL_COVERAGE = 0.995
MID_AIR_START_S = 10.0


def log_lacks(flight: Flight, replayed: ReplayedRelease) -> tuple[Finding, ...]:
    """What keeps a replay of this log from repeating the flight, in the order in which it usually matters.

    The findings have the ids of the verdict's checks that tell of the same things. `replayed` says whose estimator
    replays it.
    """
    return tuple(_lacks(flight, replayed))


def _lacks(flight: Flight, replayed: ReplayedRelease) -> Iterator[Finding]:
    imu = flight.topic("sensor_combined")
    if imu is not None and len(imu["timestamp"]) > 1:
        span_us = float(imu["timestamp"][-1] - imu["timestamp"][0])
        coverage = float(imu["gyro_integral_dt"][1:].astype(np.float64).sum()) / max(span_us, 1.0)
        if coverage < FULL_COVERAGE:
            found = f"{1 - coverage:.1%} of the IMU data is missing from the log"
            yield imu_coverage.warned(found, "", coverage, FULL_COVERAGE)
    for check, topic, what, full in (
        (magnetometer, "vehicle_magnetometer", "magnetometer", FULL_MAG_RATE_HZ),
        (barometer, "vehicle_air_data", "barometer", FULL_BARO_RATE_HZ),
        (gnss, "vehicle_gps_position", "GNSS", FULL_GNSS_RATE_HZ),
    ):
        rate = logged_rate_hz(flight.topic(topic))
        if rate is not None and rate < full:
            yield _slow(check, flight, topic, what, rate, full)
    land = flight.topic("vehicle_land_detected")
    if imu is not None and land is not None and "landed" in land and (land["landed"] == 0).any():
        take_off = float(land["timestamp"][land["landed"] == 0][0]) - float(imu["timestamp"][0])
        if take_off * 1e-6 < MID_AIR_START_S:
            lead_s = max(take_off, 0) * 1e-6
            found = f"the log starts {lead_s:.0f} s before take-off, so the replayed filter has to align in the air"
            remedy = "" if logs_from_boot(flight.parameters.at_end()) else SET_LOG_FROM_BOOT
            yield log_start.warned(found, remedy, lead_s, MID_AIR_START_S)
    if found := other_release(flight, replayed):
        yield firmware.warned(found, "")


def _slow(check: Check[JudgedFlight], flight: Flight, topic: str, what: str, rate_hz: float, full_hz: float) -> Finding:
    if is_complete(logged_share(flight, topic)):
        return check.warned(
            f"the {what} itself gives only {rate_hz:.1f} Hz; every sample is in the log", "", rate_hz, full_hz
        )
    found, remedy = f"the log holds the {what} at only {rate_hz:.1f} Hz", SET_LOG_EVERY_SAMPLE
    if logging_profile_of(flight.parameters.at_end()) & ESTIMATOR_REPLAY_BIT:
        found, remedy = f"{found} though the profile for estimator replay is set", ""
    return check.warned(found, remedy, rate_hz, full_hz)
