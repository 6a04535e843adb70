"""How close the replay of a flight's own parameters is to what the vehicle's estimator logged in that flight.

This is what tells a pilot how far the replay can be trusted on this very log. Innovations are matched by their sample
time; the vehicle logs them seldom (twice a second in the default profile), so each is set beside the replay's nearest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from fusetune.analyze.fidelity import Innovations, load_innovations, mean_nll
from fusetune.analyze.reconstruction.between_samples import logged_rate_hz
from fusetune.analyze.replay_flight import PreparedFlight
from fusetune.analyze.replay_settings import ReplaySettings
from fusetune.analyze.trust_grade import TRUST_TOPICS, grade_flight
from fusetune.analyze.trust_settings import TrustSettings
from fusetune.documents import write_document
from fusetune.files import AnyPath, atomic_path
from fusetune.px4.ekf2_parameters import BASELINE_RELEASE
from fusetune.px4.flight import Flight
from fusetune.px4.release_layouts import canonical

AS_FLOWN = "as_flown"
"""Name of the replay with the log's own parameters."""

FIDELITY_TOPICS = (*dict.fromkeys((*TRUST_TOPICS, "sensor_gps")),)
"""What the comparison and the grade read of a flight."""

JUDGED_SOURCES = ("gnss_vel", "gnss_pos", "gnss_hgt", "baro_hgt", "mag", "ev_pos", "ev_vel", "ev_hgt")
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


def write_flight_fidelity(
    flight: Flight,
    analyze_folder: AnyPath,
    replay: ReplaySettings,
    trust: TrustSettings | None = None,
    prepared: PreparedFlight | None = None,
) -> None:
    """Compare the as-flown replay of a flight with its own log, grade it, and write `fidelity.json` beside it.

    `grade` is the letter that the decision may weigh a flight by, `trust` what it follows from (see
    `fusetune.analyze.trust_grade.TrustGrade`).

    Parameters
    ----------
    flight : Flight
        With `FIDELITY_TOPICS`, as it was logged.
    analyze_folder : Path
        `results/analyze/<flight>`, with `as_flown.innovations.parquet` and `onboard.innovations.parquet`.
    replay, trust : settings
        As the replays of the flight are made, and the limits of the grades.
    prepared : PreparedFlight, optional
        What these replays shared.
    """
    analyze_folder = Path(analyze_folder)
    flight = canonical(flight, follow_primary=True)
    result = judge_onboard_fidelity(
        flight, analyze_folder / f"{AS_FLOWN}.innovations.parquet", analyze_folder / "onboard.innovations.parquet"
    )
    grade = grade_flight(flight, replay, trust, prepared)
    document = asdict(result) | {"grade": grade.grade, "trust": asdict(grade)}
    with atomic_path(analyze_folder / "fidelity.json") as path:
        write_document(path, document)


def judge_onboard_fidelity(flight: Flight, replayed: AnyPath, onboard: AnyPath) -> OnboardFidelity:
    """Compare the as-flown replay with the vehicle's own innovations.

    Parameters
    ----------
    flight : Flight
        Canonical flight, for the reasons.
    replayed, onboard : Path
        `as_flown.innovations.parquet` and `onboard.innovations.parquet`.
    """
    ours, theirs = load_innovations(replayed), load_innovations(onboard)
    theirs = theirs.rows(theirs.timestamp >= _warm(ours))
    axes = tuple(
        axis
        for source in JUDGED_SOURCES
        for number in range(3)
        if (axis := _compare_axis(source, number, ours, theirs)) is not None
    )
    median = float(np.median([axis.relative_rms for axis in axes])) if axes else None
    return OnboardFidelity(flight.name, median, axes, tuple(_reasons(flight)))


def _warm(ours: Innovations) -> int:
    """Time (µs) from which the replay has settled: ten seconds after it first fuses an aid."""
    fused = ours.timestamp[ours.fused & np.isin(ours.source, JUDGED_SOURCES)]
    return int(fused.min()) + WARM_UP_US if len(fused) else int(ours.timestamp.max(initial=0)) + 1


def _usable(rows: Innovations, source: str, axis: int) -> Innovations:
    return rows.rows((rows.source == source) & (rows.axis == axis) & (rows.variance > 0) & np.isfinite(rows.innovation))


def _compare_axis(source: str, axis: int, ours: Innovations, theirs: Innovations) -> OnboardAxis | None:
    left, right = (_usable(rows, source, axis) for rows in (ours, theirs))
    if not len(left.axis) or not len(right.axis):
        return None
    left = left.rows(np.argsort(left.timestamp, kind="stable"))
    after = np.clip(np.searchsorted(left.timestamp, right.timestamp), 1, max(len(left.axis) - 1, 1))
    after = np.minimum(after, len(left.axis) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.abs(left.timestamp[before] - right.timestamp) <= np.abs(left.timestamp[after] - right.timestamp)
    partner = np.where(nearer, before, after)
    matched = np.abs(left.timestamp[partner] - right.timestamp) <= MATCH_TOLERANCE_US
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
        variance_ratio=float(np.median(left.variance / right.variance)),
        fused_equal=float(np.mean(left.fused == right.fused)),
        rejected_equal=float(np.mean(left.rejected == right.rejected)),
        nll_difference=mean_nll(left) - mean_nll(right),
    )


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
            reasons.append(f"the log holds the {what} at only {rate:.1f} Hz (SDLOG_PROFILE bit 1 logs every sample)")
    land = flight.topic("vehicle_land_detected")
    if imu is not None and land is not None and "landed" in land and (land["landed"] == 0).any():
        take_off = float(land["timestamp"][land["landed"] == 0][0]) - float(imu["timestamp"][0])
        if take_off * 1e-6 < MID_AIR_START_S:
            reasons.append(
                f"the log starts {max(take_off, 0) * 1e-6:.0f} s before take-off, so the replayed filter has to align "
                "in the air (SDLOG_MODE 1 logs from boot)"
            )
    if flight.release is not None and flight.release[:2] != BASELINE_RELEASE:
        baseline = "v{}.{}".format(*BASELINE_RELEASE)
        reasons.append(f"the vehicle flew {flight.release_name}, the replay behaves like {baseline}")
    return reasons
