"""Which part of a flight is scored: in the air, after the warm-up, away from resets and gaps, alike for all sets."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Cut, Interval, duration, inside, merged, subtract
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.px4.aid_sources import AID_SOURCES, HORIZONTAL_AIDING

FUSION_DELAY_US = 500_000
"""Innovations belong to the fusion horizon, up to this much before the time of the output that shows a reset."""

_LONGEST_CUT_SHARE = 0.5
"""A set whose own resets cost more of the flight than this does not cut the flight of the others."""


@dataclass(frozen=True)
class ScoringWindow:
    """Scored intervals of a flight, µs, half-open and in order, with what was cut and which sets were left out."""

    intervals: tuple[Interval, ...]
    cuts: tuple[Cut, ...]
    excluded: dict[str, str]
    warm_up_end: int | None
    reason: str = ""

    @property
    def duration_s(self) -> float:
        return sum(stop - start for start, stop in self.intervals) * 1e-6

    def contains(self, time: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
        """True for the times (N,), µs, that are scored."""
        return inside(time, self.intervals)

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
    records: Sequence[ReplayedSet],
    present: str,
    airborne: Sequence[Interval],
    gaps: Sequence[Interval],
    settings: ScoringSettings,
) -> ScoringWindow:
    """Find the part of a flight on which all its parameter sets are scored alike.

    Parameters
    ----------
    records : replays of all sets on this flight, the present one among them
    present : name of the present set; what it cannot do is not asked of the others
    airborne : flight time, µs
    gaps : gaps in the IMU data, µs

    Returns
    -------
    ScoringWindow
        Without intervals, and with a reason, where nothing can be scored. A set that diverged, that never or
        late starts aiding, or that resets all the time is left out with its reason: it would cut the others.
    """
    present_record = next(record for record in records if record.name == present)
    excluded = {record.name: _failure(record) for record in records if _failure(record)}
    if present in excluded:
        return ScoringWindow((), (), excluded, None, f"the present set: {excluded[present]}")
    if not airborne:
        return ScoringWindow((), (), excluded, None, "the log holds no flight time")
    reference = aiding_start(present_record)
    assert reference is not None, "a set without aiding has failed"
    starts = {}
    for record in records:
        if record.name in excluded:
            continue
        start = aiding_start(record)
        assert start is not None, "a set without aiding has failed"
        late_s = (start - reference) * 1e-6
        if late_s > settings.max_start_delay_s:
            excluded[record.name] = f"starts aiding {late_s:.1f} s later than the present set"
        else:
            starts[record.name] = start
    settle_s = settings.warm_settle_s if present_record.is_warm_started else settings.settle_s
    warm_up_end = max(starts.values()) + round(settle_s * 1e6)
    flying = subtract(airborne, [Cut(-(2**62), warm_up_end, "warm-up")])
    single_cuts = cuts_within(records, excluded, flying, present, gaps, settings)
    cuts = merged(single_cuts)
    intervals = subtract(flying, cuts)
    window = ScoringWindow(intervals, cuts, excluded, warm_up_end)
    if window.duration_s < settings.minimum_scored_s:
        reason = (
            f"only {window.duration_s:.1f} s of flight remain after the warm-up and the cuts, "
            f"{settings.minimum_scored_s:g} s are needed: {_what_was_taken(airborne, flying, single_cuts)}"
        )
        return ScoringWindow((), cuts, excluded, warm_up_end, reason)
    return window


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
    records: Sequence[ReplayedSet],
    excluded: dict[str, str],
    flying: Sequence[Interval],
    present: str,
    gaps: Sequence[Interval],
    settings: ScoringSettings,
) -> list[Cut]:
    """Cuts around the resets of all sets and the gaps of the log inside `flying`; those at one time are one.

    `excluded` takes sets whose own resets would cost the others too much of what the present set leaves of the flight.
    """
    after = round(settings.reset_cut_s * 1e6)
    cuts = [Cut(start, stop + after, "gap in the log") for start, stop in gaps]
    of_set = {record.name: _around_resets(record, after) for record in records if record.name not in excluded}
    cuts += of_set.get(present, [])
    left = subtract(flying, cuts)
    total = duration(left)
    for name, own in of_set.items():
        lost = total - duration(subtract(left, own))
        if name != present and lost > _LONGEST_CUT_SHARE * total:
            excluded[name] = f"its resets would cut {lost * 1e-6:.1f} s of {total * 1e-6:.1f} s"
        else:
            cuts += own
    return [cut for cut in dict.fromkeys(cuts) if any(cut.stop > start and cut.start < stop for start, stop in flying)]


def _around_resets(record: ReplayedSet, after_us: int) -> list[Cut]:
    return [
        Cut(int(time) - FUSION_DELAY_US, int(time) + after_us, f"reset of {kind.replace('_', ' ')}")
        for kind, times in record.reset_times.items()
        for time in times
    ]
