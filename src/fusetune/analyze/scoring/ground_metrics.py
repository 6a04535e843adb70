"""The same filter standing on the ground: figures apart from those of the flight, as nothing moves there.

Rotors stand still, GNSS and barometer are at their calmest and a filter is easily right: mixed with flight time, a long
wait before take-off would hide how the sets differ. Apart, it shows noise without motion.
"""

from collections.abc import Sequence

import numpy as np

from fusetune.analyze.flight.intervals import Cut, Interval, merged, subtract
from fusetune.analyze.metrics.break_rate import break_rate
from fusetune.analyze.metrics.consistency import mean_nis, paper_bounds
from fusetune.analyze.metrics.innovation_metrics import rms_innovation, rms_norm
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.scoring.filter_events import FilterEvents
from fusetune.analyze.scoring.measurement_alignment import PairedSamples, SamplesOfSet, each_of, paired_samples
from fusetune.analyze.scoring.metrics_table import FEWEST_SAMPLES, MetricsTable, groups_of
from fusetune.analyze.scoring.scoring_settings import ScoringSettings
from fusetune.analyze.scoring.scoring_window import ScoringWindow, cuts_within
from fusetune.analyze.sources import AID_SOURCES, AXES

BEFORE_TAKE_OFF_US = 2_000_000
"""Cut from the ground time before a take-off: the rotors run, and the land detector tells late."""
AFTER_LANDING_US = 1_000_000


def ground_window(
    records: Sequence[ReplayedSet],
    present: str,
    airborne: Sequence[Interval],
    log: Interval,
    gaps: Sequence[Interval],
    window: ScoringWindow,
    settings: ScoringSettings,
) -> ScoringWindow:
    """Time on the ground after the warm-up, away from resets and gaps as in flight.

    Parameters
    ----------
    airborne, gaps : µs, as for `scoring_window`
    log : start and end of the log, µs
    window : of the flight; the sets that it leaves out are left out here too
    """
    flying = [Cut(start - BEFORE_TAKE_OFF_US, stop + AFTER_LANDING_US, "in the air") for start, stop in airborne]
    warm_up = [] if window.warm_up_end is None else [Cut(-(2**62), window.warm_up_end, "warm-up")]
    standing = subtract([log], [*flying, *warm_up])
    if window.warm_up_end is None or not standing:
        return ScoringWindow((), (), window.excluded, window.warm_up_end, "no time on the ground after the warm-up")
    excluded = dict(window.excluded)
    cuts = merged(cuts_within(records, excluded, standing, present, gaps, settings))
    return ScoringWindow(subtract(standing, cuts), cuts, excluded, window.warm_up_end)


def add_ground_metrics(
    table: MetricsTable, records: Sequence[ReplayedSet], present: str, ground: ScoringWindow, confidence: float
) -> None:
    """Append `ground_rms_innovation`, `ground_mean_nis` and `ground_break_rate_gate` of every source and axis."""
    if not ground.intervals:
        return
    standing = [record for record in records if record.name not in ground.excluded]
    for source in AID_SOURCES.values():
        pairs: dict[int, PairedSamples] = {}
        for axis in range(source.axes):
            found = paired_samples(standing, (source.name, axis), present, ground)
            if found is not None and found.time.size >= FEWEST_SAMPLES:
                pairs[axis] = found
                _add(table, [found], AXES[axis], confidence)
        for group, members in groups_of(pairs):
            _add(table, members, group, confidence)


def _add(table: MetricsTable, members: list[PairedSamples], axis: str, confidence: float) -> None:
    table.add_metric_by_metric([_of_one_set(table.flight, one, axis, confidence) for one in each_of(members)])


def _of_one_set(flight: str, members: list[SamplesOfSet], axis: str, confidence: float) -> MetricsTable:
    table = MetricsTable(flight)
    first, n = members[0], members[0].time.size
    innovation = np.stack([one.innovation for one in members])
    variance = np.stack([one.innovation_variance for one in members])
    rms = rms_innovation(innovation[0]) if len(members) == 1 else rms_norm(innovation)
    bounds = paper_bounds(mean_nis(innovation, variance), n, len(members), confidence)
    broken = np.logical_or.reduce([one.beyond_gate for one in members])
    table.add_each(first.sets, first.source, axis, "ground_rms_innovation", rms, n)
    table.add_bounds(first.sets, first.source, axis, "ground_mean_nis", bounds, n)
    table.add_bounds(first.sets, first.source, axis, "ground_break_rate_gate", break_rate(broken, confidence), n)
    return table


def add_ground_events(table: MetricsTable, set_name: str, events: FilterEvents, ground: ScoringWindow) -> None:
    """Append resets and timeouts on the ground after the warm-up; `n` is the time there, s."""
    for metric, count in (("ground_resets", events.total_resets), ("ground_timeouts", events.total_timeouts)):
        table.add(set_name, "filter", "all", metric, count, ground.duration_s)
