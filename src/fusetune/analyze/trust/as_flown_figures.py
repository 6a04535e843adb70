"""How far a replay of the parameters that flew is from the vehicle's own estimator: figures that do not need the same
measurements.

A default log holds two innovations a second, of GNSS samples that it mostly does not hold itself, so sample by sample
there is little to compare. What can be compared is how large the innovations are, and the state at any time: velocity,
heading, height, their resets, flags.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.replaying.onboard import onboard_samples
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.trust.compared_flags import COMPARED_FLAGS, HEIGHT_FLAGS, FlagPairs
from fusetune.analyze.trust.compared_innovations import GROUPS, innovation_ratios
from fusetune.analyze.trust.compared_position import COMPARED_FIELDS, LocalPositions
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.replay.recording import RecordArrays, with_fields
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.px4.aid_sources import HORIZONTAL_AIDING
from fusetune.px4.flight import Flight
from fusetune.px4.releases import ALL_HEIGHT_SOURCES, BASELINE, Release


@dataclass(frozen=True)
class AsFlownFigures:
    """A replay against the vehicle; a figure is None where the log does not let it be compared.

    Attributes
    ----------
    innovation_ratio : group → RMS of the replay's innovations over that of the vehicle's
    velocity_m_s, heading_deg : RMS difference of horizontal velocity and heading
    height_m : RMS difference of height less its mean, for the origin of height is arbitrary
    vertical_velocity_m_s : RMS difference of vertical velocity
    flags_equal : mean share of the time in which each flag agrees
    height_flags_equal : share of the time in which the replay takes its height from what the vehicle does; of releases
        before v1.14, which use one source at a time, it may use others beside
    compared_s : length of the flight that was compared
    resets : what was reset → how often by the replay, and by the vehicle
    """

    innovation_ratio: dict[str, float]
    velocity_m_s: float | None
    heading_deg: float | None
    height_m: float | None
    vertical_velocity_m_s: float | None
    flags_equal: float | None
    height_flags_equal: float | None
    compared_s: float
    resets: dict[str, tuple[int, int]]

    @property
    def innovation_factor(self) -> float | None:
        """By how much the innovations of the worst group are larger or smaller than the vehicle's."""
        factors = [max(ratio, 1.0 / max(ratio, 1e-9)) for ratio in self.innovation_ratio.values()]
        return max(factors, default=None)

    @property
    def height_resets(self) -> int | None:
        """By how many the resets of height or of vertical velocity, whichever parts more, differ in number."""
        return max((abs(ours - theirs) for ours, theirs in self.resets.values()), default=None)


def as_flown_figures(
    result: ReplayResult,
    measured: np.ndarray,
    flight: Flight,
    intervals: tuple[Interval, ...],
    onboard: Mapping[SourceAxis, AxisSamples] | None = None,
    replayed: Release = BASELINE,
) -> AsFlownFigures:
    """Compare a replay with the log of the vehicle's own estimator.

    Parameters
    ----------
    result, measured : of the replay, from `fusetune.analyze.replaying.replay_flight.PreparedFlight.replay`
    flight : in the layout of `fusetune.px4.layouts.release_layouts.canonical`
    intervals : parts of the flight that are compared, µs
    onboard : the vehicle's innovations; by default those of its primary instance
    replayed : the release whose estimator did it
    """
    onboard = onboard_samples(flight) if onboard is None else onboard
    local = LocalPositions(result, flight, intervals)
    flags = FlagPairs(result, flight, intervals)
    return AsFlownFigures(
        innovation_ratio=innovation_ratios(result, measured, intervals, onboard),
        velocity_m_s=local.horizontal_velocity(),
        heading_deg=local.heading(flags),
        height_m=local.height(),
        vertical_velocity_m_s=local.vertical_velocity(),
        flags_equal=flags.mean_share_equal(COMPARED_FLAGS),
        height_flags_equal=flags.share_all_equal(HEIGHT_FLAGS, beside=_has_fewer_height_sources(flight, replayed)),
        compared_s=sum(stop - start for start, stop in intervals) * 1e-6,
        resets=local.resets(),
    )


def _has_fewer_height_sources(flight: Flight, replayed: Release) -> bool:
    """Whether the vehicle's estimator took its height from one source at a time, and that of the replay does not."""
    return flight.release is not None and flight.release < ALL_HEIGHT_SOURCES <= replayed


def compared_rows(onboard: Mapping[SourceAxis, AxisSamples]) -> Callable[[RecordArrays], RecordArrays]:
    """What `as_flown_figures` needs of a replay's rows, for `fusetune.ekf2.replay.replay` to keep.

    Parameters
    ----------
    onboard : the vehicle's innovations
    """
    keys = {key for keys in GROUPS.values() for key in keys if key in onboard}
    wanted = {source for source, _ in keys} | {*HORIZONTAL_AIDING} & {*AID_SOURCE_NAMES}
    by_heading = "mag_heading" in wanted
    wanted |= {"mag"} if by_heading else set()
    sources = [AID_SOURCE_NAMES.index(name) for name in sorted(wanted)]

    def keep(rows: RecordArrays) -> RecordArrays:
        return RecordArrays(
            innovations=rows.innovations[np.isin(rows.innovations["source"], sources)],
            states=with_fields(rows.states if by_heading else rows.states[:0], ("timestamp_sample", "states")),
            local_position=with_fields(rows.local_position, COMPARED_FIELDS),
            flags=rows.flags,
        )

    return keep
