"""What to set so that the next log holds more, and nothing that is set already."""

from __future__ import annotations

from fusetune.px4.estimator_samples import is_complete, logged_share
from fusetune.px4.flight import Flight
from fusetune.px4.logger_settings import (
    ESTIMATOR_REPLAY_BIT,
    PROFILE_FOR_REPLAY,
    SET_LOG_FROM_BOOT,
    logging_profile_of,
    logs_from_boot,
)
from fusetune.px4.releases import VERBOSE_LOG

ONE_ESTIMATOR = "EKF2_MULTI_IMU = 0 and EKF2_MULTI_MAG = 0 with SENS_IMU_MODE = 1 and SENS_MAG_MODE = 1"
FASTER_CARD = "Use a faster SD card, or log fewer topics"
COPY_AGAIN = "Copy the log from the vehicle again; check the SD card"
WHOLE_LOG = "Use the log as PX4 wrote it: what made or converted this file kept some fields only"
_RATE_PARAMETERS = {
    "vehicle_magnetometer": " (SENS_MAG_RATE)",
    "vehicle_air_data": " (SENS_BARO_RATE)",
    "sensor_combined": " (IMU_INTEG_RATE)",
}


def log_more(flight: Flight, topic: str) -> str:
    """Remedy for a sensor of which the log holds few samples or none."""
    settings = flight.parameters.at_end()
    driver = f"check its driver and its rate{_RATE_PARAMETERS.get(topic, '')}"
    if is_complete(logged_share(flight, topic)):
        return f"The log holds every sample that the estimator had, so the sensor itself is slow: {driver}"
    profile = logging_profile_of(settings)
    if profile & ESTIMATOR_REPLAY_BIT:
        return f"The profile for estimator replay is set (SDLOG_PROFILE = {profile}): {driver}, or the SD card is slow"
    return f"Log with SDLOG_PROFILE = {profile | PROFILE_FOR_REPLAY} (bit 1, estimator replay, set)"


def slowness(flight: Flight, topic: str, what: str, rate_hz: float) -> str:
    """In words, that there are few samples of a sensor: of the sensor itself, or in the log."""
    if is_complete(logged_share(flight, topic)):
        return f"the {what} itself gives only {rate_hz:.1f} Hz (every sample is in the log)"
    return f"the {what} is logged at only {rate_hz:.1f} Hz"


def log_from_boot(flight: Flight) -> str:
    """Remedy for a log that begins late."""
    if logs_from_boot(flight.parameters.at_end()):
        return "The logger begins at boot already: wait longer on the ground before take-off"
    return f"Set {SET_LOG_FROM_BOOT}, so that the log begins when the autopilot starts"


NEXT_FLIGHT_TOPICS = ("estimator_status", "estimator_selector_status")
"""What `next_flight_settings` reads."""


def next_flight_settings(flight: Flight) -> str:
    """The parameters that make the log of the next flight replayable to the last sample; empty if all are set."""
    settings = flight.parameters.at_end()
    profile, advice = logging_profile_of(settings), []
    if profile & PROFILE_FOR_REPLAY != PROFILE_FOR_REPLAY:
        advice.append(f"SDLOG_PROFILE = {profile | PROFILE_FOR_REPLAY} (adds the set for estimator replay)")
    if not logs_from_boot(settings):
        advice.append(SET_LOG_FROM_BOOT)
    if len(flight.instances("estimator_status")) > 1 or flight.has("estimator_selector_status"):
        advice.append(f"{ONE_ESTIMATOR} (one estimator on one IMU)")
    is_verbose = settings.get("EKF2_LOG_VERBOSE") == 1
    if not is_verbose and (flight.release is None or flight.release >= VERBOSE_LOG):
        advice.append("EKF2_LOG_VERBOSE = 1")
    return f"For the next flight set {'; '.join(advice)}; then restart" if advice else ""
