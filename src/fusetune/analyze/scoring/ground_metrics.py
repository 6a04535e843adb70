"""The same filter standing on the ground: figures apart from those of the flight, as nothing moves there.

Rotors stand still, GNSS and barometer are at their calmest and a filter is easily right: mixed with flight time, a long
wait before take-off would hide how the sets differ. Apart, it shows noise without motion.
"""

from collections.abc import Iterable, Mapping, Sequence

from fusetune.analyze.flight.intervals import Cut, Interval, merged, subtract
from fusetune.analyze.metrics.declared import INNOVATION_METRICS
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.samples import SourceAxis
from fusetune.analyze.scoring.filter_events import ON_GROUND, FilterEvents
from fusetune.analyze.scoring.measurement_alignment import Counted, sets_together
from fusetune.analyze.scoring.metrics_table import MetricsTable, add_innovation_metrics
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.window import ScoringWindow, after, cuts_within

BEFORE_TAKE_OFF_US = 2_000_000
"""Cut from the ground time before a take-off: the rotors run, and the land detector tells late."""
AFTER_LANDING_US = 1_000_000
GROUND = "ground_"
"""Before the name of a metric that is given of the time on the ground."""
_ON_GROUND = tuple(metric for metric in INNOVATION_METRICS if metric.on_ground)


def ground_window(
    present: ReplayedSet,
    airborne: Sequence[Interval],
    log: Interval,
    gaps: Sequence[Interval],
    window: ScoringWindow,
    settings: ScoringSettings,
) -> ScoringWindow:
    """Time on the ground after the warm-up, away from resets and gaps as in flight.

    Parameters
    ----------
    present : replay of the set from whose resets it follows
    airborne, gaps : µs, as for `scoring_window`
    log : start and end of the log, µs
    window : of the flight
    """
    flying = [Cut(start - BEFORE_TAKE_OFF_US, stop + AFTER_LANDING_US, "in the air") for start, stop in airborne]
    standing = subtract([log], flying)
    if window.warm_up_end is not None:
        standing = after(standing, window.warm_up_end)
    if window.warm_up_end is None or not standing:
        return ScoringWindow((), (), window.excluded, window.warm_up_end, "no time on the ground after the warm-up")
    cuts = merged(cuts_within(present, standing, gaps, settings))
    intervals = subtract(standing, cuts)
    return ScoringWindow(intervals, cuts, window.excluded, window.warm_up_end)


def add_ground_metrics(
    tables: Mapping[str, MetricsTable],
    sources: Sequence[Iterable[Mapping[SourceAxis, Counted]]],
    settings: ScoringSettings,
) -> None:
    """Append the metrics that are given of the ground, of every source and axis, named `ground_…`.

    Parameters
    ----------
    tables : of each of the sets, by name
    sources : samples of each set on the ground, source by source
    """
    names = [*tables]
    for found in zip(*sources, strict=True):
        for places, together in sets_together([one.values() for one in found], settings.confidence):
            own = {names[place]: tables[names[place]] for place in places}
            add_innovation_metrics(own, together, _ON_GROUND, GROUND)


def add_ground_events(table: MetricsTable, set_name: str, events: FilterEvents, ground: ScoringWindow) -> None:
    """Append resets and timeouts on the ground after the warm-up; `n` is the time there, s."""
    for metric in ON_GROUND:
        count = metric.function(events)["all"]
        table.add(set_name, "filter", "all", GROUND + metric.name, count, ground.duration_s)
