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

from fusetune.analyze.replaying.onboard import onboard_samples
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.analyze.sources import HORIZONTAL_AIDING
from fusetune.ekf2.filter.common import state as S
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.replay.recording import FLAG_COLUMNS, RecordArrays, with_fields
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.px4.flight import Flight, TopicTable, row_count
from fusetune.px4.layouts.estimator_instances import instance_switches, rows_of_primary

GROUPS: Mapping[str, tuple[SourceAxis, ...]] = {
    "horizontal_velocity": (("gnss_vel", 0), ("gnss_vel", 1)),
    "horizontal_position": (("gnss_pos", 0), ("gnss_pos", 1)),
    "heading": (("mag_heading", 0),),
    "gnss_heading": (("gnss_yaw", 0),),
    "magnetic_field": (("mag", 0), ("mag", 1), ("mag", 2)),
    "vision_velocity": (("ev_vel", 0), ("ev_vel", 1)),
    "vision_position": (("ev_pos", 0), ("ev_pos", 1)),
    "vision_heading": (("ev_yaw", 0),),
    "optical_flow": (("optical_flow", 0), ("optical_flow", 1)),
}
"""Innovations that are compared by their size."""

NEAR_US = 1_000_000
"""Innovations of the replay count within this time of one that the vehicle fused: it may use a source for a while."""

COMPARED_FLAGS = (
    "cs_tilt_align", "cs_yaw_align", "cs_gnss_pos", "cs_baro_hgt", "cs_ev_pos", "cs_opt_flow", "cs_in_air",
    "fs_bad_acc_vertical",
)  # fmt: skip
"""Flags that mean the same in all releases."""

HEIGHT_FLAGS = ("cs_baro_hgt", "cs_gps_hgt", "cs_rng_hgt", "cs_ev_hgt")
"""What the height is taken from."""

ONE_HEIGHT_SOURCE_BEFORE = (1, 14)
"""Earlier releases take the height from one source at a time, v1.16 from all that are enabled."""

HEIGHT_RESETS = {"z_reset_counter": "height", "vz_reset_counter": "vertical velocity"}
"""Counter of `vehicle_local_position` → what was reset."""

SWITCH_US = 1_000_000
"""Resets this soon after another estimator instance became primary are the selector's, which a replay has not."""

MIN_SAMPLES = 8
Interval = tuple[int, int]


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
) -> AsFlownFigures:
    """Compare a replay with the log of the vehicle's own estimator.

    Parameters
    ----------
    result, measured : of the replay, from `fusetune.analyze.replaying.replay_flight.PreparedFlight.replay`
    flight : in the layout of `fusetune.px4.layouts.release_layouts.canonical`
    intervals : parts of the flight that are compared, µs
    onboard : the vehicle's innovations; by default those of its primary instance
    """
    onboard = onboard_samples(flight) if onboard is None else onboard
    local = _LocalPositions(result, flight, intervals)
    flags = _FlagPairs(result, flight, intervals)
    return AsFlownFigures(
        innovation_ratio=_innovation_ratios(result, measured, intervals, onboard),
        velocity_m_s=local.horizontal_velocity(),
        heading_deg=local.heading(flags),
        height_m=local.height(),
        vertical_velocity_m_s=local.vertical_velocity(),
        flags_equal=flags.mean_share_equal(COMPARED_FLAGS),
        height_flags_equal=flags.share_all_equal(HEIGHT_FLAGS, beside=_has_one_height_source(flight)),
        compared_s=sum(stop - start for start, stop in intervals) * 1e-6,
        resets=local.resets(),
    )


def _has_one_height_source(flight: Flight) -> bool:
    return flight.release is not None and flight.release[:2] < ONE_HEIGHT_SOURCE_BEFORE


def _innovation_ratios(
    result: ReplayResult,
    measured: np.ndarray,
    intervals: tuple[Interval, ...],
    onboard: Mapping[SourceAxis, AxisSamples],
) -> dict[str, float]:
    ratios = {}
    for group, keys in GROUPS.items():
        ours, theirs = [], []
        for key in keys:
            if key in onboard:
                time, innovation = replayed_innovations(result, measured, *key)
                logged = onboard[key]
                flown = _inside(logged.timestamp_sample, intervals) & logged.fused
                used = _inside(time, intervals) & _near(time, logged.timestamp_sample[flown])
                ours.append(innovation[used])
                theirs.append(logged.innovation[flown])
        if ours and min(sum(map(len, ours)), sum(map(len, theirs))) >= MIN_SAMPLES * len(ours):
            ratios[group] = rms(ours) / max(rms(theirs), 1e-9)
    return ratios


def _near(time: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Whether any of `others`, ascending, lies within `NEAR_US` of each time."""
    if not len(others):
        return np.zeros(len(time), np.bool_)
    after = np.minimum(np.searchsorted(others, time), len(others) - 1)
    before = np.maximum(after - 1, 0)
    return np.minimum(np.abs(others[after] - time), np.abs(others[before] - time)) <= NEAR_US


def compared_rows(onboard: Mapping[SourceAxis, AxisSamples]) -> Callable[[RecordArrays], RecordArrays]:
    """What `as_flown_figures` needs of a replay's rows, for `fusetune.ekf2.replay.replay` to keep.

    Parameters
    ----------
    onboard : the vehicle's innovations
    """
    keys = {key for keys in GROUPS.values() for key in keys if key in onboard}
    wanted = {source for source, _ in keys} | {*HORIZONTAL_AIDING} & {*AID_SOURCE_NAMES}
    by_heading = "mag_heading" in wanted
    wanted = wanted - {"mag_heading"} | ({"mag"} if by_heading else set())
    sources = [AID_SOURCE_NAMES.index(name) for name in sorted(wanted)]

    def keep(rows: RecordArrays) -> RecordArrays:
        return RecordArrays(
            innovations=rows.innovations[np.isin(rows.innovations["source"], sources)],
            states=with_fields(rows.states if by_heading else rows.states[:0], ("timestamp_sample", "states")),
            local_position=with_fields(rows.local_position, _COMPARED_FIELDS),
            flags=rows.flags,
        )

    return keep


def rms(parts: list[np.ndarray]) -> float:
    """Root mean square over several arrays."""
    values = np.concatenate(parts)
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def replayed_innovations(
    result: ReplayResult, measured: np.ndarray, source: str, axis: int
) -> tuple[np.ndarray, np.ndarray]:
    """Times and innovations of measured samples from the first that was fused on, for before it they mean nothing.

    `mag_heading` is made from the magnetometer's.
    """
    if source == "mag_heading":
        return _heading_innovations(result, measured)
    rows = result.innovations[
        (result.innovations["source"] == AID_SOURCE_NAMES.index(source))
        & (result.innovations["axis"] == axis)
        & measured
    ]
    rows = rows[rows["innovation_variance"] > 0]
    rows = rows[int(np.argmax(rows["fused"])) :] if rows["fused"].any() else rows[:0]
    return rows["timestamp_sample"], rows["innovation"].astype(np.float64)


def _heading_innovations(result: ReplayResult, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angle (rad) from the estimated magnetic north to where the measured field points, seen in the estimated frame.

    That is what releases before v1.14 fused as heading: predicted minus measured yaw.
    """
    rows = result.innovations
    chosen = (rows["source"] == AID_SOURCE_NAMES.index("mag")) & measured
    axes = [rows[chosen & (rows["axis"] == axis)] for axis in range(3)]
    if not len(axes[0]) or not len(result.states):
        return np.zeros(0, np.int64), np.zeros(0)
    time = axes[0]["timestamp_sample"]
    at = np.clip(np.searchsorted(result.states["timestamp_sample"], time), 0, len(result.states) - 1)
    states = result.states["states"][at].astype(np.float64)
    field = np.stack([axis["observation"] for axis in axes], axis=-1).astype(np.float64)
    field -= states[:, S.PUBLISHED_MAG_BODY : S.PUBLISHED_MAG_BODY + 3]
    w, x, y, z = (states[:, S.PUBLISHED_QUATERNION + i] for i in range(4))
    north = (
        (1 - 2 * (y * y + z * z)) * field[:, 0] + 2 * (x * y - w * z) * field[:, 1] + 2 * (x * z + w * y) * field[:, 2]
    )
    east = (
        2 * (x * y + w * z) * field[:, 0] + (1 - 2 * (x * x + z * z)) * field[:, 1] + 2 * (y * z - w * x) * field[:, 2]
    )
    earth = states[:, S.PUBLISHED_MAG_EARTH : S.PUBLISHED_MAG_EARTH + 2]
    known = np.linalg.norm(earth, axis=1) > 0.0
    angle = np.arctan2(east, north) - np.arctan2(earth[:, 1], earth[:, 0])
    return time[known], _wrapped(angle[known])


def _wrapped(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _inside(time: np.ndarray, intervals: tuple[Interval, ...]) -> np.ndarray:
    inside = np.zeros(len(time), np.bool_)
    for start, stop in intervals:
        inside |= (time >= start) & (time < stop)
    return inside


_COMPARED_FIELDS = ("timestamp", "vx", "vy", "vz", "z", "heading", *HEIGHT_RESETS)


class _LocalPositions:
    """`vehicle_local_position` of the vehicle beside that of a replay."""

    def __init__(self, result: ReplayResult, flight: Flight, intervals: tuple[Interval, ...]) -> None:
        self.flight, self.intervals = flight, intervals
        self.ours = result.local_position
        table = flight.topic("vehicle_local_position")
        self.theirs: TopicTable = table if table is not None and len(self.ours) >= 2 else {"timestamp": np.zeros(0)}
        self.time = self.theirs.get("timestamp_sample", self.theirs["timestamp"]).astype(np.int64)
        self.shared = _inside(self.time, intervals)
        if len(self.time):
            self.shared &= (self.time >= self.ours["timestamp"][0]) & (self.time <= self.ours["timestamp"][-1])

    def horizontal_velocity(self) -> float | None:
        usable = self._usable("v_xy_valid", "xy_valid", needs=("vx", "vy"))
        if usable is None:
            return None
        squares = self._difference("vx", usable) ** 2 + self._difference("vy", usable) ** 2
        return float(np.sqrt(np.mean(squares)))

    def height(self) -> float | None:
        usable = self._usable("z_valid", needs=("z",))
        return None if usable is None else float(np.std(self._difference("z", usable)))

    def vertical_velocity(self) -> float | None:
        usable = self._usable("v_z_valid", needs=("vz",))
        return None if usable is None else float(np.sqrt(np.mean(self._difference("vz", usable) ** 2)))

    def heading(self, flags: _FlagPairs) -> float | None:
        """RMS difference of heading, degrees, while the vehicle's is aligned: before, it is any."""
        name = next((name for name in ("heading", "yaw") if name in self.theirs), None)
        usable = None if name is None else self._usable(needs=(name,))
        if usable is None or name is None:
            return None
        aligned = flags.vehicle("cs_yaw_align", self.time)
        usable &= self._flag("xy_valid") if aligned is None else aligned
        if usable.sum() < MIN_SAMPLES:
            return None
        at = np.clip(np.searchsorted(self.ours["timestamp"], self.time[usable]), 0, len(self.ours) - 1)
        difference = _wrapped(self.ours["heading"][at] - self.theirs[name][usable].astype(np.float64))
        return float(np.degrees(np.sqrt(np.mean(difference**2))))

    def resets(self) -> dict[str, tuple[int, int]]:
        """Resets of the replay and of the vehicle in the compared parts, but those that follow a change of instance."""
        found = {}
        for counter, words in HEIGHT_RESETS.items():
            if counter in self.theirs and self.shared.sum() >= MIN_SAMPLES:
                theirs = _increments(self.theirs[counter], modulo=256)
                ours = _increments(self.ours[counter])
                found[words] = (self._counted(self.ours["timestamp"], ours), self._counted(self.time, theirs))
        return found

    def _counted(self, time: np.ndarray, increments: np.ndarray) -> int:
        since = np.full(len(time), 2**62)
        for switch in instance_switches(self.flight):
            since = np.where(time >= switch, np.minimum(since, time - switch), since)
        return int(increments[_inside(time, self.intervals) & (since > SWITCH_US)].sum())

    def _flag(self, name: str) -> np.ndarray:
        return self.theirs[name].astype(bool) if name in self.theirs else np.ones(len(self.time), np.bool_)

    def _usable(self, *flags: str, needs: tuple[str, ...]) -> np.ndarray | None:
        """Rows that are compared and that the vehicle called valid; None where there are too few."""
        if any(name not in self.theirs for name in needs):
            return None
        usable = self.shared.copy()
        for name in flags:
            usable &= self._flag(name)
        for name in needs:
            usable &= np.isfinite(self.theirs[name].astype(np.float64))
        return usable if usable.sum() >= MIN_SAMPLES else None

    def _difference(self, name: str, usable: np.ndarray) -> np.ndarray:
        ours = np.interp(self.time[usable], self.ours["timestamp"], self.ours[name])
        return np.asarray(ours - self.theirs[name][usable].astype(np.float64))


def _increments(counter: np.ndarray, modulo: int = 2**31) -> np.ndarray:
    """Increments of a counter that wraps around, at the row that shows them."""
    count = counter.astype(np.int64)
    return np.mod(np.diff(count, prepend=count[:1]), modulo)


class _FlagPairs:
    """Status flags of the vehicle beside those of a replay, ten times a second."""

    STEP_US = 100_000

    def __init__(self, result: ReplayResult, flight: Flight, intervals: tuple[Interval, ...]) -> None:
        self.table = rows_of_primary(flight, "estimator_status_flags")
        self.flags = result.flags
        steps = [np.arange(start, stop, self.STEP_US) for start, stop in intervals]
        self.times = np.concatenate([np.zeros(0, np.int64), *steps])

    def vehicle(self, name: str, times: np.ndarray) -> np.ndarray | None:
        """A flag of the vehicle as last logged before each time."""
        if self.table is None or name not in self.table or not row_count(self.table):
            return None
        rows = np.searchsorted(self.table["timestamp"].astype(np.int64), times, side="right") - 1
        return np.asarray(self.table[name][np.maximum(rows, 0)].astype(bool))

    def mean_share_equal(self, names: tuple[str, ...]) -> float | None:
        """Share of the time in which a flag agrees, mean over the flags."""
        shares = [float(np.mean(ours == theirs)) for ours, theirs in self._pairs(names)]
        return float(np.mean(shares)) if shares else None

    def share_all_equal(self, names: tuple[str, ...], *, beside: bool) -> float | None:
        """Share of the time in which all flags agree; with `beside` the replay may have others set, too."""
        pairs = self._pairs(names)
        if not pairs or not any(theirs.any() for _, theirs in pairs):
            return None
        agree = [(ours == theirs) | (ours & beside) for ours, theirs in pairs]
        return float(np.mean(np.all(agree, axis=0)))

    def _pairs(self, names: tuple[str, ...]) -> list[tuple[np.ndarray, np.ndarray]]:
        if not len(self.flags) or not len(self.times):
            return []
        rows = np.maximum(np.searchsorted(self.flags["timestamp"], self.times, side="right") - 1, 0)
        pairs = []
        for name in names:
            theirs = self.vehicle(name, self.times)
            if theirs is not None:
                pairs.append((self.flags["flags"][rows, FLAG_COLUMNS.index(name)].astype(bool), theirs))
        return pairs
