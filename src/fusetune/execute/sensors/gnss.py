"""GNSS receiver (`vehicle_gps_position`): late, with errors that are partly white and partly correlated in time."""

from __future__ import annotations

import calendar
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fusetune.execute.noise import gauss_markov, random_stream
from fusetune.execute.sensors.faults import (
    Fault,
    GnssAccuracy,
    GnssGlitch,
    GnssInterference,
    GnssOutage,
    of_kind,
)
from fusetune.execute.sensors.sampling import sample_times
from fusetune.execute.vehicle import Environment, Gnss, GnssError
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable, select_rows

DEVICE_ID = 11469325
FIX_3D = 3
NO_FIX = 0
REPORT_CORRELATION_S = 30.0
SATELLITE_DEVIATION = 1.2
START_OF_FLIGHT_UTC_S = 10 * 3600
"""The flights begin at ten in the morning, UTC."""
LOST_EPH_M, LOST_EPV_M, LOST_SPEED_ACCURACY_M_S, LOST_DOP = 4294.0, 3750.0, 20.0, 99.99
"""What a receiver reports when it has lost its position."""
QUIET_JAMMING, QUIET_NOISE, QUIET_GAIN = 12, 90, 3000
"""Jamming indicator (0–255), noise per ms and gain count of a u-blox M8 where nothing disturbs it."""
JAMMED_JAMMING, JAMMED_NOISE, JAMMED_GAIN = 220, 210, 1100
JAMMING_OK, JAMMING_WARNING, JAMMING_CRITICAL = 1, 2, 3
JAMMING_WARNS_FROM, JAMMING_CRITICAL_FROM = 0.25, 0.6
"""Strengths of interference from which the receiver says so."""
JAMMED_ERROR_FACTOR = 8.0
LOST_BY_JAMMER = 0.65
"""Share of the satellites that the strongest jammer takes."""
FLICKERS_FROM, FLICKER_S, FLICKER_SHARE = 0.4, 1.5, 0.6
"""The fix goes and comes from that strength on, for so long at a time, up to that share of the time."""


@dataclass(frozen=True)
class _Measured:
    """What the receiver measures at N instants."""

    sampled_us: np.ndarray
    received_us: np.ndarray
    position: np.ndarray
    """(N, 3) m, tangent frame, of the antenna."""
    velocity_ned: np.ndarray


def vehicle_gps_position(
    truth: Truth, gnss: Gnss, environment: Environment, geoid_undulation_m: float, faults: Sequence[Fault], seed: int
) -> TopicTable:
    """GNSS samples in the layout of PX4 v1.16's topic, `timestamp` being the time of receipt.

    `timestamp_sample` is 0: receiver drivers of that release do not know the time of measurement.
    """
    measured = _measure(truth, gnss, faults, seed)
    samples = len(measured.sampled_us)
    lat, lon, height = truth.frame.to_geodetic(measured.position)
    velocity = measured.velocity_ned.astype(np.float32)
    after_takeoff_s = measured.sampled_us * 1e-6 - truth.events.takeoff_s
    jammed = _jamming(after_takeoff_s, faults)
    reported = _reported(gnss, _error_factor(after_takeoff_s, faults), jammed, seed)
    zeros, nan = np.zeros(samples, np.float32), np.full(samples, np.nan, np.float32)
    midnight_s = calendar.timegm(environment.date.timetuple())
    table: TopicTable = {
        "timestamp": measured.received_us.astype(np.int64),
        "timestamp_sample": np.zeros(samples, np.int64),
        "latitude_deg": np.degrees(lat),
        "longitude_deg": np.degrees(lon),
        "altitude_msl_m": height - geoid_undulation_m,
        "altitude_ellipsoid_m": height,
        "time_utc_usec": (measured.sampled_us + (midnight_s + START_OF_FLIGHT_UTC_S) * 1_000_000).astype(np.uint64),
        "device_id": np.full(samples, DEVICE_ID, np.uint32),
        "s_variance_m_s": reported["s_variance_m_s"],
        "c_variance_rad": np.full(samples, 0.1, np.float32),
        "eph": reported["eph"],
        "epv": reported["epv"],
        "hdop": reported["hdop"],
        "vdop": reported["vdop"],
        "noise_per_ms": _between(QUIET_NOISE, JAMMED_NOISE, jammed).astype(np.int32),
        "jamming_indicator": _between(QUIET_JAMMING, JAMMED_JAMMING, jammed).astype(np.int32),
        "vel_m_s": np.hypot(velocity[:, 0], velocity[:, 1]),
        "vel_n_m_s": velocity[:, 0],
        "vel_e_m_s": velocity[:, 1],
        "vel_d_m_s": velocity[:, 2],
        "cog_rad": np.arctan2(velocity[:, 1], velocity[:, 0]),
        "timestamp_time_relative": np.zeros(samples, np.int32),
        "heading": nan,
        "heading_offset": nan.copy(),
        "heading_accuracy": nan.copy(),
        "rtcm_injection_rate": zeros,
        "automatic_gain_control": _between(QUIET_GAIN, JAMMED_GAIN, jammed).astype(np.uint16),
        "fix_type": np.full(samples, FIX_3D, np.uint8),
        "jamming_state": (JAMMING_OK + (jammed >= JAMMING_WARNS_FROM) + (jammed >= JAMMING_CRITICAL_FROM)).astype(
            np.uint8
        ),
        "spoofing_state": np.ones(samples, np.uint8),
        "vel_ned_valid": np.ones(samples, np.bool_),
        "satellites_used": reported["satellites_used"],
        "selected_rtcm_instance": np.zeros(samples, np.uint8),
        "rtcm_crc_failed": np.zeros(samples, np.bool_),
        "rtcm_msg_used": np.zeros(samples, np.uint8),
    }
    _lose_fix(table, _flickers(after_takeoff_s, jammed, seed))
    return _with_outages(table, after_takeoff_s, faults)


def _between(quiet: float, jammed: float, strength: np.ndarray) -> np.ndarray:
    return np.asarray(np.rint(quiet + (jammed - quiet) * strength))


def _jamming(after_takeoff_s: np.ndarray, faults: Sequence[Fault]) -> np.ndarray:
    """Strength of interference at each sample, 0 where there is none, (N,)."""
    strength = np.zeros(len(after_takeoff_s))
    for fault in of_kind(faults, GnssInterference):
        strength[fault.holds(after_takeoff_s)] = fault.strength
    return strength


def _error_factor(after_takeoff_s: np.ndarray, faults: Sequence[Fault]) -> np.ndarray:
    """How much larger errors and reported accuracies are than usual, (N,)."""
    factor = 1.0 + (JAMMED_ERROR_FACTOR - 1.0) * _jamming(after_takeoff_s, faults)
    for fault in of_kind(faults, GnssAccuracy):
        factor[fault.holds(after_takeoff_s)] *= fault.factor
    return np.asarray(factor)


def _flickers(after_takeoff_s: np.ndarray, jammed: np.ndarray, seed: int) -> np.ndarray:
    """When a jammed receiver has no fix, (N,) bool."""
    slot = np.floor(after_takeoff_s / FLICKER_S).astype(np.int64)
    draws = random_stream(seed, "gnss flicker").random(slot.max(initial=0) - slot.min(initial=0) + 1)
    share = FLICKER_SHARE * np.maximum(jammed - FLICKERS_FROM, 0.0) / (1.0 - FLICKERS_FROM)
    return np.asarray(draws[slot - slot.min(initial=0)] < share)


def _measure(truth: Truth, gnss: Gnss, faults: Sequence[Fault], seed: int) -> _Measured:
    rng = random_stream(seed, "gnss")
    sampled_us = sample_times(truth, gnss.rate_hz, rng)
    jitter_us = np.rint(1e3 * gnss.delay_jitter_ms * rng.standard_normal(len(sampled_us))).astype(np.int64)
    delay_us = np.maximum(round(1e3 * gnss.delay_ms) + jitter_us, 0)
    attitude = truth.attitude_at(sampled_us)
    antenna = np.array(gnss.antenna_position_m)
    position = truth.at(sampled_us, truth.position) + attitude.apply(antenna)
    turning = np.cross(truth.body_rate_at(sampled_us), antenna)
    velocity = truth.at(sampled_us, truth.velocity) + attitude.apply(turning)
    lat, lon, _ = truth.frame.to_geodetic(position)
    velocity_ned = np.einsum("nij,ni->nj", truth.frame.local_axes(lat, lon), velocity)
    factor = _error_factor(sampled_us * 1e-6 - truth.events.takeoff_s, faults)[:, None]
    position = position + factor * _error(
        gnss.position, gnss.rate_hz, len(sampled_us), random_stream(seed, "gnss position")
    )
    velocity_ned = velocity_ned + factor * _error(
        gnss.velocity, gnss.rate_hz, len(sampled_us), random_stream(seed, "gnss velocity")
    )
    for fault in of_kind(faults, GnssGlitch):
        on = fault.holds(sampled_us * 1e-6 - truth.events.takeoff_s)
        position[on] += np.array(fault.offset_m)
        velocity_ned[on] += np.array(fault.velocity_offset_m_s)
    return _Measured(sampled_us, sampled_us + delay_us, position, velocity_ned)


def _error(error: GnssError, rate_hz: float, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Error north, east, down, (samples, 3)."""
    correlated = gauss_markov(rng, samples, 3, 1.0 / rate_hz, error.correlated, error.correlation_time_s)
    white = error.noise * rng.standard_normal((samples, 3))
    return np.asarray((correlated + white) * np.array([1.0, 1.0, error.vertical_factor]))


def _reported(gnss: Gnss, worse: np.ndarray, jammed: np.ndarray, seed: int) -> TopicTable:
    """Accuracy figures as the receiver reports them: they wander slowly, together with the satellites in view."""
    rng = random_stream(seed, "gnss reported")
    wander = gauss_markov(rng, len(worse), 1, 1.0 / gnss.rate_hz, 1.0, REPORT_CORRELATION_S)[:, 0]
    factor = np.exp(gnss.reported.variation * wander) * worse
    satellites = gnss.satellites - SATELLITE_DEVIATION * wander * (gnss.reported.variation > 0.0)
    satellites = np.rint(satellites * (1.0 - LOST_BY_JAMMER * jammed))
    return {
        "eph": (gnss.reported.eph_m * factor).astype(np.float32),
        "epv": (gnss.reported.epv_m * factor).astype(np.float32),
        "s_variance_m_s": (gnss.reported.s_variance_m_s * factor).astype(np.float32),
        "hdop": (gnss.hdop * np.sqrt(factor)).astype(np.float32),
        "vdop": (gnss.vdop * np.sqrt(factor)).astype(np.float32),
        "satellites_used": np.maximum(satellites, 4).astype(np.uint8),
    }


def _with_outages(table: TopicTable, after_takeoff_s: np.ndarray, faults: Sequence[Fault]) -> TopicTable:
    silent = np.zeros(len(after_takeoff_s), np.bool_)
    for fault in of_kind(faults, GnssOutage):
        on = fault.holds(after_takeoff_s)
        if fault.silent:
            silent |= on
        else:
            _lose_fix(table, on)
    return select_rows(table, ~silent)


def _lose_fix(table: TopicTable, on: np.ndarray) -> None:
    """Let the receiver report no fix in some rows, (N,) bool."""
    if not on.any():
        return
    for column, value in (
        ("fix_type", NO_FIX),
        ("satellites_used", 2),
        ("vel_ned_valid", False),
        ("eph", LOST_EPH_M),
        ("epv", LOST_EPV_M),
        ("s_variance_m_s", LOST_SPEED_ACCURACY_M_S),
        ("hdop", LOST_DOP),
        ("vdop", LOST_DOP),
    ):
        table[column][on] = value
    _freeze_position(table, on)


def _freeze_position(table: TopicTable, lost: np.ndarray) -> None:
    """While there is no fix the receiver repeats its last position and no velocity."""
    index = np.arange(len(lost))
    last_good = np.maximum.accumulate(np.where(lost, 0, index))
    for column in ("latitude_deg", "longitude_deg", "altitude_msl_m", "altitude_ellipsoid_m"):
        table[column] = table[column][last_good]
    for column in ("vel_m_s", "vel_n_m_s", "vel_e_m_s", "vel_d_m_s"):
        table[column][lost] = 0.0
