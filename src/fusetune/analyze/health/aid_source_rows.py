"""Test ratios, rejections and gaps of each aid source, from the vehicle or from the replay."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval, inside, subtract
from fusetune.analyze.health.health_row import HealthRow, Origin
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.over_time import Stretch, longest_between, silences, span
from fusetune.analyze.health.ratio_figures import ratio_rows
from fusetune.analyze.health.settings import REJECTED_RATIO, Levels
from fusetune.analyze.health.subject import Subject
from fusetune.analyze.metrics.grouping import distinct
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.px4.aid_sources import MEASURED_SOURCES, AidSource
from fusetune.px4.flight import TopicTable
from fusetune.px4.releases import ALL_HEIGHT_SOURCES

Samples = Mapping[SourceAxis, AxisSamples]
Figures = npt.NDArray[np.float64]

GROUP = "aid source"
UNFILTERED = "innovation² / (gate² × innovation variance) of each sample, the largest of the axes"
AS_LOGGED = "estimator_innovation_test_ratios, unfiltered; the innovations were thinned apart from their variances"
_CLEAR_OF_GROUND = frozenset({"height", "heading", "field", "flow"})
"""Quantities that ground effect and the fields near the ground falsify."""
_OUT_OF_RANGE = frozenset({"rng_hgt", "optical_flow", "airspeed", "sideslip", "drag", "aux_vel", "gravity"})
"""Sources that are not fused at times by design: out of range, too slow, at rest."""
_LOOSE = frozenset({"rng_hgt", "optical_flow"})
_OTHER_WAYS = {"mag": "mag_heading"}
"""Before v1.15 the magnetometer is fused in three axes or as a heading, by turns."""
_SILENT_S = (1.0, 3.0)
"""When nothing of an estimator is logged for so long, the log does not tell what it fused; by how often it is."""
_LOOK_AT = "See which sensor is off: its mounting, interference, the noise and the gate that EKF2 is told"


def aid_source_rows(health: JudgedHealth, samples: Samples, instance: int, origin: Origin) -> Iterator[HealthRow]:
    """Rows of all sources that one estimator had; samples are those of `onboard_samples` or of a replay."""
    told = told_windows(health, samples, origin)
    for source in MEASURED_SOURCES.values():
        axes = {axis: samples[source.name, axis] for axis in range(source.axes) if (source.name, axis) in samples}
        if axes:
            yield from _source_rows(health, source, axes, instance, origin)
            if source.name not in _OTHER_WAYS.values() and (source.name, 0) in samples:
                yield _unfused_row(health, source, samples, told, instance, origin)
        elif instance == health.primary and _may_fuse(health, source):
            yield Subject(source.name, source.label, GROUP, instance, origin).lacking(
                "raised_share", "no innovations in the log"
            )


def told_windows(health: JudgedHealth, samples: Samples, origin: Origin) -> tuple[Interval, ...]:
    """Time in flight, less what the log is silent about: an estimator's topics are thinned each by itself."""
    if origin == "replay":
        return health.airborne
    times = [samples[key].timestamp_sample for key in samples if not key[1]]
    edges = np.array(health.airborne, np.int64).reshape(-1)
    return subtract(health.airborne, silences(distinct(np.concatenate([edges, *times])), _SILENT_S)) if times else ()


def _source_rows(
    health: JudgedHealth, source: AidSource, axes: dict[int, AxisSamples], instance: int, origin: Origin
) -> Iterator[HealthRow]:
    first = next(iter(axes.values()))
    within = health.clear if source.quantity in _CLEAR_OF_GROUND else health.airborne
    counted = inside(first.timestamp_sample, within)
    whole = Subject(source.name, health.name_of(source.label, instance), GROUP, instance, origin)
    in_use = first.fused.any() or (_may_fuse(health, source) and first.rejected.any())
    if not counted.any() or not in_use:
        yield whole.lacking("raised_share", "not in use" if within else "not in flight")
        return
    for group, members in _groups(source):
        here = [axes[axis] for axis in members if axis in axes and axes[axis].timestamp_sample.size == counted.size]
        if not here:
            continue
        ratio = np.fmax.reduce([one.test_ratio for one in here])
        subject = _subject(whole, source, group)
        known = counted & np.isfinite(ratio)
        if not known.any():
            yield subject.lacking("raised_share", "its test ratios are not logged")
            continue
        ratio_is = AS_LOGGED if np.isnan(first.innovation).all() else UNFILTERED
        evidence: dict[str, int | str] = {"ratio": ratio_is, "samples": int(known.sum())}
        yield from ratio_rows(
            health,
            subject,
            first.timestamp_sample[known],
            ratio[known],
            within,
            evidence,
            judged=not source.every_update,
        )
        yield _rejected_row(health, subject, source, first, known, ratio)


def _groups(source: AidSource) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """Axes that are judged together, under the group's name; of several groups the one of all axes says nothing new."""
    if len(source.groups) < 2:
        return (("", tuple(range(source.axes))),)
    return tuple(group for group in source.groups if len(group[1]) < source.axes)


def _subject(whole: Subject, source: AidSource, group: str) -> Subject:
    if not group:
        return whole
    label = whole.label.replace(source.label, f"{source.label}, {group}", 1)
    return Subject(f"{source.name}_{group}", label, GROUP, whole.instance, whole.origin)


def _may_fuse(health: JudgedHealth, source: AidSource) -> bool:
    return source.switch is not None and source.switch.is_on(health.parameters[source.switch.parameter])


def _rejected_row(
    health: JudgedHealth,
    subject: Subject,
    source: AidSource,
    samples: AxisSamples,
    known: npt.NDArray[np.bool_],
    ratio: Figures,
) -> HealthRow:
    """A sample of several groups is rejected as a whole; it counts for those whose own ratio is beyond the gate."""
    rejected = samples.rejected & known
    if len(source.groups) > 1:
        rejected = rejected & (ratio > REJECTED_RATIO)
    when = samples.timestamp_sample[rejected]
    limits = health.limits.loose_rejected_share if source.name in _LOOSE else health.limits.rejected_share
    # gravity is rejected by design whenever the vehicle accelerates
    judged = known.sum() >= health.limits.fewest_samples and not source.every_update
    return subject.judged(
        "rejected_share",
        "samples rejected:",
        float(rejected.sum() / known.sum()),
        "",
        Levels(*limits) if judged else Levels(np.inf),
        remedy=_LOOK_AT,
        when=span(when),
        evidence={"rejected": int(rejected.sum()), "samples": int(known.sum())},
    )


def _unfused_row(
    health: JudgedHealth,
    source: AidSource,
    samples: Samples,
    told: Sequence[Interval],
    instance: int,
    origin: Origin,
) -> HealthRow:
    """Longest time in flight, after the first fusion, without a sample fused in any way."""
    subject = Subject(source.name, health.name_of(source.label, instance), GROUP, instance, origin)
    ways = [one for one in (source.name, _OTHER_WAYS.get(source.name, "")) if (one, 0) in samples]
    fused = distinct(np.concatenate([_fused_times(samples[one, 0]) for one in ways]))
    if not fused.size:
        return subject.lacking("longest_unfused_s", "never fused")
    within = tuple((max(start, int(fused[0])), stop) for start, stop in told if stop > fused[0])
    table = health.topic(source.topic, instance) if origin == "vehicle" else None
    longest = _since_last_fusion(table, within) or longest_between(fused, within)
    one_at_a_time = source.quantity == "height" and (health.flight.release or ALL_HEIGHT_SOURCES) < ALL_HEIGHT_SOURCES
    judged = _may_fuse(health, source) and source.name not in _OUT_OF_RANGE and not one_at_a_time
    return subject.judged(
        "longest_unfused_s",
        "longest time without fusion",
        longest.value,
        "s",
        Levels(health.limits.unfused_s) if judged else Levels(np.inf),
        remedy="See whether its samples were rejected or did not come",
        when=longest.when,
    )


def _fused_times(samples: AxisSamples) -> npt.NDArray[np.int64]:
    return samples.timestamp_sample[samples.fused]


def _since_last_fusion(table: TopicTable | None, within: tuple[Interval, ...]) -> Stretch | None:
    """Longest time without fusion by the filter's own record of the last one, which a thinned log has as well."""
    names = [name for name in table or () if name.startswith("time_last_fuse")]
    if table is None or not names or not within:
        return None
    last = np.min([table[name].astype(np.int64) for name in names], axis=0)
    sampled = np.asarray(table.get("timestamp_sample", table["timestamp"]), np.int64)
    counted = inside(sampled, within) & (last > 0)
    if not counted.any():
        return None
    since = np.where(counted, sampled - last, 0)
    row = int(np.argmax(since))
    if since[row] <= 0:
        return Stretch(0.0, None)
    return Stretch(float(since[row]) * 1e-6, (int(last[row]), int(sampled[row])))
