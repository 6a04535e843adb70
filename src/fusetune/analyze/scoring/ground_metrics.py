"""The same filter standing on the ground: figures apart from those of the flight, as nothing moves there.

Rotors stand still, GNSS and barometer are at their calmest and a filter is easily right: mixed with flight time, a long
wait before take-off would hide how the sets differ. Apart, it shows noise without motion.
"""

from collections.abc import Sequence

from fusetune.analyze.flight.intervals import Cut, Interval, merged, subtract
from fusetune.analyze.metrics.declared import INNOVATION_METRICS
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.scoring.filter_events import ON_GROUND, FilterEvents
from fusetune.analyze.scoring.measurement_alignment import PairedSamples, paired_samples
from fusetune.analyze.scoring.metrics_table import FEWEST_SAMPLES, MetricsTable, add_innovation_metrics, groups_of
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.window import ScoringWindow, after, cuts_within, own_resets
from fusetune.px4.aid_sources import AXES, MEASURED_SOURCES

BEFORE_TAKE_OFF_US = 2_000_000
"""Cut from the ground time before a take-off: the rotors run, and the land detector tells late."""
AFTER_LANDING_US = 1_000_000
GROUND = "ground_"
"""Before the name of a metric that is given of the time on the ground."""


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
    standing = subtract([log], flying)
    if window.warm_up_end is not None:
        standing = after(standing, window.warm_up_end)
    if window.warm_up_end is None or not standing:
        return ScoringWindow((), (), window.excluded, window.warm_up_end, "no time on the ground after the warm-up")
    present_record = next(record for record in records if record.name == present)
    cuts = merged(cuts_within(present_record, standing, gaps, settings))
    intervals = subtract(standing, cuts)
    own = own_resets(records, present, intervals, settings)
    return ScoringWindow(intervals, cuts, window.excluded, window.warm_up_end, own_resets=own)


def add_ground_metrics(
    table: MetricsTable, records: Sequence[ReplayedSet], present: str, ground: ScoringWindow, settings: ScoringSettings
) -> None:
    """Append the metrics that are given of the ground, of every source and axis, named `ground_…`."""
    if not ground.intervals:
        return
    metrics = [metric for metric in INNOVATION_METRICS if metric.on_ground]
    standing = [record for record in records if record.name not in ground.excluded]
    for source in MEASURED_SOURCES.values():
        pairs: dict[int, PairedSamples] = {}
        for axis in range(source.axes):
            found = paired_samples(standing, (source.name, axis), present, ground, settings=settings)
            if found is not None and found.time.size >= FEWEST_SAMPLES:
                pairs[axis] = found
        single = [(AXES[axis], [one]) for axis, one in pairs.items()]
        for axis_name, members in (*single, *groups_of(pairs)):
            add_innovation_metrics(table, members, axis_name, metrics, settings.confidence, GROUND)


def add_ground_events(table: MetricsTable, set_name: str, events: FilterEvents, ground: ScoringWindow) -> None:
    """Append resets and timeouts on the ground after the warm-up; `n` is the time there, s."""
    for metric in ON_GROUND:
        count = metric.function(events)["all"]
        table.add(set_name, "filter", "all", GROUND + metric.name, count, ground.duration_s)
