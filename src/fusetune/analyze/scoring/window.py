"""Which part of a flight is scored: in the air, after the warm-up, away from resets and gaps.

It follows from the present set and the log alone, so that no other set can take evidence from the rest. What such a set
does in it is its own affair: resets of its own do not cut, see `fusetune.analyze.scoring.charges`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Cut, Interval, duration, inside, merged, subtract
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.px4.aid_sources import AID_SOURCES, HORIZONTAL_AIDING

FUSION_DELAY_US = 500_000
"""Innovations belong to the fusion horizon, up to this much before the time of the output that shows a reset."""


@dataclass(frozen=True)
class ScoringWindow:
    """Scored intervals of a flight, µs, half-open and in order, with what was cut and which sets were left out.

    As it is for a set other than the present one (`of_set`), `own_resets` holds the times around its resets, which are
    scored all the same, and `excluded` why it is left out.
    """

    intervals: tuple[Interval, ...]
    cuts: tuple[Cut, ...]
    excluded: dict[str, str]
    warm_up_end: int | None
    reason: str = ""
    own_resets: Mapping[str, tuple[Cut, ...]] = field(default_factory=dict)

    @property
    def duration_s(self) -> float:
        return duration(self.intervals) * 1e-6

    def contains(self, time: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
        """True for the times (N,), µs, that are scored."""
        return inside(time, self.intervals)

    def after_own_reset(self, name: str, time: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
        """True for the times (N,), µs, around a reset of that set alone."""
        return inside(time, [(cut.start, cut.stop) for cut in self.own_resets.get(name, ())])

    def own_resets_s(self, name: str) -> float:
        """Scored time around resets of that set alone."""
        left = subtract(self.intervals, self.own_resets.get(name, ()))
        return (duration(self.intervals) - duration(left)) * 1e-6

    def of_set(self, record: ReplayedSet, settings: ScoringSettings) -> ScoringWindow:
        """The same window as it is for a set other than the present one: its own resets, and why it is left out."""
        reason, own = _failure(record), own_resets(record, self.intervals, settings)
        return replace(
            self, excluded={record.name: reason} if reason else {}, own_resets={record.name: own} if own else {}
        )

    def block_edges(self, length_s: float) -> npt.NDArray[np.int64]:
        """Edges of blocks of equal length, as near to `length_s` as the span of the window allows, µs."""
        start, stop = self.intervals[0][0], self.intervals[-1][1]
        blocks = max(1, round((stop - start) * 1e-6 / length_s))
        return start + (np.arange(blocks + 1, dtype=np.int64) * (stop - start)) // blocks


def aiding_start(record: ReplayedSet) -> int | None:
    """Time at which the set first fuses something that stops horizontal drift, else anything at all, µs."""
    anything = {source for source, _ in record.samples if not AID_SOURCES[source].every_update}
    for sources in (HORIZONTAL_AIDING, anything):
        starts = [start for (source, _), start in record.first_fused.items() if source in sources]
        if starts:
            return min(starts)
    return None


def scoring_window(
    present: ReplayedSet, airborne: Sequence[Interval], gaps: Sequence[Interval], settings: ScoringSettings
) -> ScoringWindow:
    """Find the part of a flight on which all its parameter sets are scored alike.

    Parameters
    ----------
    present : replay of the present set, from whose warm-up and resets the window follows
    airborne : flight time, µs
    gaps : gaps in the IMU data, µs

    Returns
    -------
    ScoringWindow
        Without intervals, and with a reason, where nothing can be scored: as where the set diverged or never starts
        aiding.
    """
    failure = _failure(present)
    if failure:
        return ScoringWindow((), (), {present.name: failure}, None, f"the present set: {failure}")
    if not airborne:
        return ScoringWindow((), (), {}, None, "the log holds no flight time")
    warm_up_end = end_of_warm_up(present, present, settings)
    flying = after(airborne, warm_up_end)
    single_cuts = cuts_within(present, flying, gaps, settings)
    cuts = merged(single_cuts)
    window = ScoringWindow(subtract(flying, cuts), cuts, {}, warm_up_end)
    if window.duration_s < settings.minimum_scored_s:
        reason = (
            f"only {window.duration_s:.1f} s of flight remain after the warm-up and the cuts, "
            f"{settings.minimum_scored_s:g} s are needed: {_what_was_taken(airborne, flying, single_cuts)}"
        )
        return ScoringWindow((), cuts, {}, warm_up_end, reason)
    return window


def end_of_warm_up(record: ReplayedSet, present: ReplayedSet, settings: ScoringSettings) -> int:
    """When a set has settled after it started aiding, µs, but not before the present one has."""
    settle_s = settings.warm_settle_s if present.is_warm_started else settings.settle_s
    starts = [start for one in (record, present) if (start := aiding_start(one)) is not None]
    assert starts, "a set without aiding has failed"
    return max(starts) + round(settle_s * 1e6)


def after(intervals: Sequence[Interval], time_us: int) -> tuple[Interval, ...]:
    """What of the intervals lies after a time."""
    return subtract(intervals, [Cut(-(2**62), time_us, "warm-up")])


def _what_was_taken(airborne: Sequence[Interval], flying: Sequence[Interval], cuts: Sequence[Cut]) -> str:
    """In words, how much of the flight the warm-up and each kind of cut takes, the largest first."""
    total = duration(airborne)
    takes = [("the warm-up takes", total - duration(flying))]
    for reason in sorted({cut.reason for cut in cuts}):
        own = [cut for cut in cuts if cut.reason == reason]
        what, verb = (reason, "takes") if len(own) == 1 else (_plural(reason), "take")
        takes.append((f"{len(own)} {what} {verb}", duration(flying) - duration(subtract(flying, own))))
    told = [f"{words} {taken * 1e-6:.1f} s" for words, taken in sorted(takes, key=lambda one: -one[1]) if taken > 0]
    return f"of {total * 1e-6:.1f} s in the air " + (", ".join(told) if told else "none is cut")


def _plural(reason: str) -> str:
    first, _, rest = reason.partition(" ")
    return f"{first}s {rest}"


def _failure(record: ReplayedSet) -> str:
    if record.status != "ok":
        return f"{record.status}: {record.summary.get('reason', '')}".rstrip(": ")
    if aiding_start(record) is None:
        return "no aid source was ever fused"
    return ""


def cuts_within(
    present: ReplayedSet, flying: Sequence[Interval], gaps: Sequence[Interval], settings: ScoringSettings
) -> list[Cut]:
    """Cuts around the resets of the present set and the gaps of the log inside `flying`; those at one time are one."""
    behind = round(settings.reset_cut_s * 1e6)
    cuts = [Cut(start, stop + behind, "gap in the log") for start, stop in gaps]
    return _within([*cuts, *_around_resets(present, behind)], flying)


def own_resets(record: ReplayedSet, intervals: Sequence[Interval], settings: ScoringSettings) -> tuple[Cut, ...]:
    """Times around the resets of a set other than the present one that reach into the intervals."""
    return merged(_within(_around_resets(record, round(settings.reset_cut_s * 1e6)), intervals))


def _within(cuts: Sequence[Cut], intervals: Sequence[Interval]) -> list[Cut]:
    return [
        cut for cut in dict.fromkeys(cuts) if any(cut.stop > start and cut.start < stop for start, stop in intervals)
    ]


def _around_resets(record: ReplayedSet, after_us: int) -> list[Cut]:
    return [
        Cut(int(time) - FUSION_DELAY_US, int(time) + after_us, f"reset of {kind.replace('_', ' ')}")
        for kind, times in record.reset_times.items()
        for time in times
    ]
