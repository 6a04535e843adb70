"""How close the replay of a flight's own parameters is to what the vehicle's estimator logged in that flight.

This is what tells a pilot how far the replay can be trusted on this very log. Innovations are matched by their sample
time; the vehicle logs them seldom (twice a second in the default profile), so each is set beside the replay's nearest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight_files import FIDELITY_FILE
from fusetune.analyze.replaying.onboard import onboard_samples
from fusetune.analyze.replaying.prepared_flight import PreparedFlight
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.replaying.store.parts import table_file
from fusetune.analyze.replaying.store.reader import read_innovations
from fusetune.analyze.trust.fidelity import mean_nll
from fusetune.analyze.trust.grade import TrustGrade
from fusetune.analyze.trust.log_lacks import log_lacks
from fusetune.finding import Finding
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.px4.flight import Flight
from fusetune.save.replayed_release import ReplayedRelease
from fusetune.set_names import AS_FLOWN
from fusetune.storage.documents import write_document
from fusetune.storage.files import AnyPath, atomic_path

JUDGED_SOURCES = tuple(one.name for one in AID_SOURCES.values() if one.judged)
MATCH_TOLERANCE_US = 30_000
MIN_SAMPLES = 8
WARM_UP_US = 10_000_000


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
    reasons: tuple[Finding, ...]
    """What the log lacks for a closer replay, most important first."""


def write_flight_fidelity(prepared: PreparedFlight, analyze_folder: AnyPath, grade: TrustGrade) -> None:
    """Compare the as-flown replay of a flight with its own log, and write `fidelity.json` with it and the grade.

    `grade` is the letter that the decision may weigh a flight by, `trust` what it follows from.

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
    result = judge_onboard_fidelity(prepared.flight, replayed, onboard_samples(prepared.flight), prepared.replayed)
    document = asdict(result) | {"grade": grade.grade, "trust": asdict(grade)}
    with atomic_path(Path(analyze_folder) / FIDELITY_FILE) as path:
        write_document(path, document)


def judge_onboard_fidelity(
    flight: Flight,
    ours: Mapping[SourceAxis, AxisSamples],
    theirs: Mapping[SourceAxis, AxisSamples],
    replayed: ReplayedRelease,
) -> OnboardFidelity:
    """Compare the as-flown replay with the vehicle's own innovations.

    Parameters
    ----------
    flight : canonical, for the reasons
    ours, theirs : innovations of the replay and of the vehicle, by source and axis
    replayed : whose estimator did it
    """
    since = warm_from(ours)
    axes = tuple(
        axis
        for source in JUDGED_SOURCES
        for number in range(3)
        if (source, number) in ours
        and (source, number) in theirs
        and (axis := _compare_axis(source, number, ours[source, number], theirs[source, number], since)) is not None
    )
    median = float(np.median([axis.relative_rms for axis in axes])) if axes else None
    return OnboardFidelity(flight.name, median, axes, log_lacks(flight, replayed))


def warm_from(ours: Mapping[SourceAxis, AxisSamples]) -> int:
    """Time (µs) from which the replay has settled: ten seconds after it first fuses an aid."""
    first, last = [], [0]
    for source, axis in ours:
        samples = ours[source, axis]
        last.append(int(samples.timestamp_sample.max(initial=0)))
        if source in JUDGED_SOURCES and samples.fused.any():
            first.append(int(samples.timestamp_sample[samples.fused].min()))
    return min(first) + WARM_UP_US if first else max(last) + 1


def usable(samples: AxisSamples, since: int = 0) -> AxisSamples:
    """Samples with an innovation and its variance, from a time (µs) on, in order of time."""
    sound = (samples.innovation_variance > 0) & np.isfinite(samples.innovation)
    samples = samples.rows(sound & (samples.timestamp_sample >= since))
    return samples.rows(np.argsort(samples.timestamp_sample, kind="stable"))


def partners(
    times: npt.NDArray[np.int64], wanted: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """The nearest of some ordered times (N,), one at least, to each wanted one (M,), and whether it is near enough.

    Returns
    -------
    (M,) index of the nearest, (M,) whether it is within `MATCH_TOLERANCE_US`
    """
    after = np.minimum(np.searchsorted(times, wanted), len(times) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.abs(times[before] - wanted) <= np.abs(times[after] - wanted)
    partner = np.where(nearer, before, after)
    return partner, np.abs(times[partner] - wanted) <= MATCH_TOLERANCE_US


def _compare_axis(source: str, axis: int, ours: AxisSamples, theirs: AxisSamples, since: int) -> OnboardAxis | None:
    left, right = usable(ours), usable(theirs, since)
    if not left.timestamp_sample.size or not right.timestamp_sample.size:
        return None
    partner, matched = partners(left.timestamp_sample, right.timestamp_sample)
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


def _mean_nll(samples: AxisSamples) -> float:
    return mean_nll(samples.innovation, samples.innovation_variance)
