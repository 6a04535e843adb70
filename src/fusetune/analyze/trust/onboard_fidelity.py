"""How close the replay of a flight's own parameters is to what the vehicle's estimator logged in that flight.

This is what tells a pilot how far the replay can be trusted on this very log. Innovations are matched by their sample
time; the vehicle logs them seldom (twice a second in the default profile), so each is set beside the replay's nearest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from fusetune.analyze.flight_files import FIDELITY_FILE
from fusetune.analyze.reconstruction.between_samples import logged_rate_hz
from fusetune.analyze.replaying.onboard import onboard_samples
from fusetune.analyze.replaying.prepared_flight import PreparedFlight
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.replaying.store.parts import table_file
from fusetune.analyze.replaying.store.reader import read_innovations
from fusetune.analyze.trust.fidelity import mean_nll
from fusetune.analyze.trust.trust_grade import TrustGrade
from fusetune.px4.estimator_samples import is_complete, logged_share
from fusetune.px4.flight import Flight
from fusetune.px4.logger_settings import (
    ESTIMATOR_REPLAY_BIT,
    SET_LOG_EVERY_SAMPLE,
    SET_LOG_FROM_BOOT,
    logging_profile_of,
    logs_from_boot,
)
from fusetune.px4.parameters.ekf2_parameters import BASELINE_RELEASE
from fusetune.set_names import AS_FLOWN
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path

JUDGED_SOURCES = (
    "gnss_vel", "gnss_pos", "gnss_hgt", "gnss_yaw", "baro_hgt", "rng_hgt", "mag", "ev_pos", "ev_vel", "ev_hgt",
    "ev_yaw", "optical_flow",
)  # fmt: skip
MATCH_TOLERANCE_US = 30_000
MIN_SAMPLES = 8
WARM_UP_US = 10_000_000
FULL_MAG_RATE_HZ, FULL_BARO_RATE_HZ, FULL_GNSS_RATE_HZ = 20.0, 10.0, 4.5
FULL_COVERAGE = 0.995
MID_AIR_START_S = 10.0


@dataclass(frozen=True)
class OnboardAxis:
    """One axis of one aid source, replay against vehicle."""

    source: str
    axis: int
    samples: int
    relative_rms: float
    """RMS of the innovation difference over RMS of the vehicle's innovation."""
    rms_ratio: float
    variance_ratio: float
    """Median of replayed over logged innovation variance."""
    fused_equal: float
    rejected_equal: float
    nll_difference: float


@dataclass(frozen=True)
class OnboardFidelity:
    """The replay of one flight against its log, sample by sample."""

    flight: str
    median_relative_rms: float | None
    """None where the vehicle logged no innovations that the replay could be compared with."""
    axes: tuple[OnboardAxis, ...]
    reasons: tuple[str, ...]
    """What the log lacks for a closer replay, most important first."""


def write_flight_fidelity(prepared: PreparedFlight, analyze_folder: AnyPath, grade: TrustGrade) -> None:
    """Compare the as-flown replay of a flight with its own log, and write `fidelity.json` with it and the grade.

    The grade is the letter that the decision may weigh a flight by.

    Parameters
    ----------
    prepared : with `TRUST_TOPICS`
    analyze_folder : `results/analyze/<flight>`, with the as-flown replay

    Raises
    ------
    UserError
        If the file of the replay is missing or damaged.
    """
    replayed = read_innovations(table_file(analyze_folder, AS_FLOWN, "innovations"), {})
    result = judge_onboard_fidelity(prepared.flight, replayed, onboard_samples(prepared.flight))
    document = asdict(result) | {"grade": grade.grade, "trust": asdict(grade)}
    with atomic_path(Path(analyze_folder) / FIDELITY_FILE) as path:
        write_document(path, document)


def judge_onboard_fidelity(
    flight: Flight, ours: Mapping[SourceAxis, AxisSamples], theirs: Mapping[SourceAxis, AxisSamples]
) -> OnboardFidelity:
    """Compare the as-flown replay with the vehicle's own innovations.

    Parameters
    ----------
    flight : canonical, for the reasons
    ours, theirs : innovations of the replay and of the vehicle, by source and axis
    """
    since = _warm(ours)
    axes = tuple(
        axis
        for source in JUDGED_SOURCES
        for number in range(3)
        if (source, number) in ours
        and (source, number) in theirs
        and (axis := _compare_axis(source, number, ours[source, number], theirs[source, number], since)) is not None
    )
    median = float(np.median([axis.relative_rms for axis in axes])) if axes else None
    return OnboardFidelity(flight.name, median, axes, tuple(_reasons(flight)))


def _warm(ours: Mapping[SourceAxis, AxisSamples]) -> int:
    """Time (µs) from which the replay has settled: ten seconds after it first fuses an aid."""
    first, last = [], [0]
    for source, axis in ours:
        samples = ours[source, axis]
        last.append(int(samples.timestamp_sample.max(initial=0)))
        if source in JUDGED_SOURCES and samples.fused.any():
            first.append(int(samples.timestamp_sample[samples.fused].min()))
    return min(first) + WARM_UP_US if first else max(last) + 1


def _usable(samples: AxisSamples, since: int = 0) -> AxisSamples:
    usable = (samples.innovation_variance > 0) & np.isfinite(samples.innovation)
    return samples.rows(usable & (samples.timestamp_sample >= since))


def _compare_axis(source: str, axis: int, ours: AxisSamples, theirs: AxisSamples, since: int) -> OnboardAxis | None:
    left, right = _usable(ours), _usable(theirs, since)
    left_time, right_time = left.timestamp_sample, right.timestamp_sample
    if not len(left_time) or not len(right_time):
        return None
    left = left.rows(np.argsort(left_time, kind="stable"))
    left_time = left.timestamp_sample
    after = np.clip(np.searchsorted(left_time, right_time), 1, max(len(left_time) - 1, 1))
    after = np.minimum(after, len(left_time) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.abs(left_time[before] - right_time) <= np.abs(left_time[after] - right_time)
    partner = np.where(nearer, before, after)
    matched = np.abs(left_time[partner] - right_time) <= MATCH_TOLERANCE_US
    if matched.sum() < MIN_SAMPLES:
        return None
    left, right = left.rows(partner[matched]), right.rows(matched)
    rms = max(float(np.sqrt(np.mean(right.innovation**2))), 1e-9)
    return OnboardAxis(
        source=source,
        axis=axis,
        samples=int(matched.sum()),
        relative_rms=float(np.sqrt(np.mean((left.innovation - right.innovation) ** 2))) / rms,
        rms_ratio=float(np.sqrt(np.mean(left.innovation**2))) / rms,
        variance_ratio=float(np.median(left.innovation_variance / right.innovation_variance)),
        fused_equal=float(np.mean(left.fused == right.fused)),
        rejected_equal=float(np.mean(left.rejected == right.rejected)),
        nll_difference=_mean_nll(left) - _mean_nll(right),
    )


def _why_slow(flight: Flight, topic: str, what: str, rate_hz: float) -> str:
    if is_complete(logged_share(flight, topic)):
        return f"the {what} itself gives only {rate_hz:.1f} Hz; every sample is in the log"
    if logging_profile_of(flight.parameters.at_end()) & ESTIMATOR_REPLAY_BIT:
        return f"the log holds the {what} at only {rate_hz:.1f} Hz though the profile for estimator replay is set"
    return f"the log holds the {what} at only {rate_hz:.1f} Hz ({SET_LOG_EVERY_SAMPLE})"


def _late_advice(flight: Flight) -> str:
    return "" if logs_from_boot(flight.parameters.at_end()) else f" ({SET_LOG_FROM_BOOT})"


def _mean_nll(samples: AxisSamples) -> float:
    return mean_nll(samples.innovation, samples.innovation_variance)


def _reasons(flight: Flight) -> Sequence[str]:
    """What keeps a replay of this log from repeating the flight, in the order in which it usually matters."""
    reasons = []
    imu = flight.topic("sensor_combined")
    if imu is not None and len(imu["timestamp"]) > 1:
        span_us = float(imu["timestamp"][-1] - imu["timestamp"][0])
        coverage = float(imu["gyro_integral_dt"][1:].astype(np.float64).sum()) / max(span_us, 1.0)
        if coverage < FULL_COVERAGE:
            reasons.append(f"{1 - coverage:.1%} of the IMU data is missing from the log")
    for topic, what, full in (
        ("vehicle_magnetometer", "magnetometer", FULL_MAG_RATE_HZ),
        ("vehicle_air_data", "barometer", FULL_BARO_RATE_HZ),
        ("vehicle_gps_position", "GNSS", FULL_GNSS_RATE_HZ),
    ):
        rate = logged_rate_hz(flight.topic(topic))
        if rate is not None and rate < full:
            reasons.append(_why_slow(flight, topic, what, rate))
    land = flight.topic("vehicle_land_detected")
    if imu is not None and land is not None and "landed" in land and (land["landed"] == 0).any():
        take_off = float(land["timestamp"][land["landed"] == 0][0]) - float(imu["timestamp"][0])
        if take_off * 1e-6 < MID_AIR_START_S:
            reasons.append(
                f"the log starts {max(take_off, 0) * 1e-6:.0f} s before take-off, so the replayed filter has to align "
                f"in the air{_late_advice(flight)}"
            )
    if flight.release is not None and flight.release[:2] != BASELINE_RELEASE:
        baseline = "v{}.{}".format(*BASELINE_RELEASE)
        reasons.append(f"the vehicle flew {flight.release_name}, the replay behaves like {baseline}")
    return reasons
