"""How far the replay of one flight can be trusted: a grade from A to D, and what costs most.

The parameters that flew are replayed and compared with what the vehicle's own estimator logged, as the log is and after
reconstruction. Each figure of the comparison has a grade; the worst is the flight's, and what could not be compared
limits it. What a cause costs is measured by switching it: a repair is left out, the start made cold, every second GNSS
sample dropped.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.reconstruction import RECONSTRUCTION_TOPICS
from fusetune.analyze.replaying.onboard import INNOVATION_TOPICS, onboard_samples
from fusetune.analyze.replaying.prepared_flight import PreparedFlight, prepare
from fusetune.analyze.replaying.settings import IN_USE, ReplaySettings
from fusetune.analyze.replaying.start_choice import START_TOPICS, Start
from fusetune.analyze.trust.as_flown_comparison import AsFlownComparison, distance
from fusetune.analyze.trust.as_flown_figures import AsFlownFigures
from fusetune.analyze.trust.compared_innovations import GROUPS, rms
from fusetune.analyze.trust.grade_causes import causes_of, cost_of
from fusetune.analyze.trust.settings import FALLING, FIGURES, TrustSettings
from fusetune.analyze.trust.words import GRADES, limits_of_grade, not_compared
from fusetune.finding import Finding
from fusetune.px4.aid_sources import AID_SOURCE_TOPIC, MEASURED_SOURCES
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.estimator_instances import instance_shares

GRADE_WORDS = {
    "A": "The replay repeats what the vehicle's own filter did.",
    "B": "The replay follows the vehicle's own filter closely; differences between sets can be trusted.",
    "C": "The replay resembles the vehicle's own filter; trust clear differences between sets only.",
    "D": "The replay could not be shown to do what the vehicle's own filter did.",
}
TRUST_TOPICS = (
    *dict.fromkeys(
        (
            *RECONSTRUCTION_TOPICS,
            *START_TOPICS,
            *INNOVATION_TOPICS,
            "sensor_gps",
        )
    ),
)
"""What the grade, and the comparison with the vehicle, read of a flight."""

COMPARED_SOURCES = tuple(name for name, source in MEASURED_SOURCES.items() if source.judged or source.size_figure)
"""Of which they read more than when they had samples."""

NOTHING_COMPARED = "nothing_compared"
"""Id of the finding that limits a flight of which nothing could be compared."""


@dataclass(frozen=True)
class InstanceFigures:
    """As flown, one estimator instance of the vehicle: size of its innovations, and how long it was the primary one."""

    instance: int
    primary_share: float
    innovation_rms: dict[str, float]


@dataclass(frozen=True)
class TrustGrade:
    """Grade of one flight; `as_logged` is the replay of the log as it is, from nothing, `repaired` the one in use."""

    grade: str
    words: str
    reason: str
    """What limits the grade, and what costs most of what could not be repaired, in words; empty for an A."""
    limits: tuple[Finding, ...]
    """What limits the grade: figures that have it, and what could not be compared."""
    start: str
    as_logged_grade: str
    as_logged: AsFlownFigures
    repaired: AsFlownFigures
    is_compared: bool
    """Whether the log held anything that speaks for the replay, or against it."""
    figure_grades: dict[str, str]
    not_compared: tuple[str, ...]
    """Figures that the log does not let be compared."""
    causes: tuple[Finding, ...]
    """What keeps, or kept, the replay from repeating the flight, the costliest first (`grade_causes.cause`)."""
    instances: tuple[InstanceFigures, ...]


class Graded(NamedTuple):
    """Grade of some figures, that of each, and which could not be compared."""

    grade: str
    figure_grades: dict[str, str]
    not_compared: tuple[str, ...]

    @property
    def is_compared(self) -> bool:
        """Whether anything speaks for the replay, or against it."""
        return any(name not in _NO_PREDICTION or grade == "D" for name, grade in self.figure_grades.items())


_NO_PREDICTION = ("height_resets", *FALLING)
"""Alone these do not speak for a replay: they say nothing of how well the filter predicts."""


def grade_of(figures: AsFlownFigures, settings: TrustSettings) -> Graded:
    """The worst grade of the figures, limited by those that could not be compared; D where there is none to compare."""
    grades = {}
    for name in FIGURES:
        value = getattr(figures, name)
        if value is not None:
            limits = getattr(settings, name)
            missed = sum(value < limit if name in FALLING else value > limit for limit in limits)
            grades[name] = GRADES[missed if math.isfinite(value) else 3]
    missing = tuple(name for name in FIGURES if name not in grades)
    if all(name in _NO_PREDICTION for name in grades):
        return Graded("D", grades, missing)
    return Graded(max(_best_without(missing, settings), *grades.values()), grades, missing)


def _best_without(missing: tuple[str, ...], settings: TrustSettings) -> str:
    """The best grade that can be given without these figures."""
    if any(name in settings.needed_for_b for name in missing):
        return "C"
    return "B" if any(name in settings.needed_for_a for name in missing) else "A"


def grade_flight(
    prepared: PreparedFlight,
    replay: ReplaySettings = IN_USE,
    settings: TrustSettings | None = None,
    comparison: AsFlownComparison | None = None,
) -> TrustGrade:
    """Grade one flight.

    Parameters
    ----------
    prepared : with `TRUST_TOPICS`
    replay : as it was prepared
    comparison : with this flight, under these settings, where some replay has been compared already
    """
    settings, flight = settings or TrustSettings(), prepared.flight
    comparison = comparison or AsFlownComparison(flight, settings)
    prepared = dataclasses.replace(prepared, gaps=())
    repaired = comparison.figures(prepared)
    raw = comparison.figures(_as_logged(flight, prepared, replay))
    graded = grade_of(repaired, settings)
    limits = _limits(graded, repaired, settings)
    causes: tuple[Finding, ...] = ()
    if settings.causes and math.isfinite(distance(repaired, settings)):
        causes = causes_of(comparison, prepared, replay, repaired)
    return TrustGrade(
        grade=graded.grade,
        words=GRADE_WORDS[graded.grade],
        reason=_reason(limits, causes),
        limits=limits,
        start=f"{prepared.start.mode}: {prepared.start.why}",
        as_logged_grade=grade_of(raw, settings)[0],
        as_logged=raw,
        repaired=repaired,
        is_compared=graded.is_compared,
        figure_grades=graded.figure_grades,
        not_compared=graded.not_compared,
        causes=causes,
        instances=_instances(flight),
    )


def _limits(graded: Graded, figures: AsFlownFigures, settings: TrustSettings) -> tuple[Finding, ...]:
    """Why the grade is no A: the figures that have it, and those that could not be compared."""
    if graded.grade == "A":
        return ()
    if not graded.is_compared:
        found = "the log holds nothing of the vehicle's own estimator that could be compared"
        return (Finding(NOTHING_COMPARED, "warning", found),)
    worst = [name for name, grade in graded.figure_grades.items() if grade == graded.grade]
    missing = (not_compared(graded.not_compared),) if graded.not_compared else ()
    return (*limits_of_grade(figures, worst, graded.grade, settings), *missing)


def _reason(limits: Sequence[Finding], causes: Sequence[Finding]) -> str:
    """What limits the grade, and the largest cause that is not repaired; nothing where nothing limits it."""
    if not limits or limits[0].id == NOTHING_COMPARED:
        return "; ".join(limit.found for limit in limits)
    largest = [one for one in causes if not one.evidence["repaired"] and cost_of(one) > 0.0][:1]
    return "; ".join(one.found for one in (*limits, *largest))


def _as_logged(flight: Flight, prepared: PreparedFlight, replay: ReplaySettings) -> PreparedFlight:
    """The flight as the log is, replayed from nothing; where nothing was missing, with the samples of `prepared`."""
    if replay.reconstruction is None or prepared.reconstructed.changed:
        return prepare(flight, release=prepared.replayed.asked)
    return dataclasses.replace(prepared, start=Start(None, "asked for"), handovers=())


def _instances(flight: Flight) -> tuple[InstanceFigures, ...]:
    """Innovations of every estimator instance of the vehicle, while it flew."""
    shares = instance_shares(flight)
    airborne = airborne_intervals(flight, {})
    topics = [name for name, _ in flight.topics if name.startswith(AID_SOURCE_TOPIC)]
    figures = []
    for instance in sorted({k for name in topics for k in flight.instances(name)}):
        samples = onboard_samples(flight, instance)
        sizes = {}
        for group, keys in GROUPS.items():
            parts = []
            for key in keys:
                if key in samples:
                    one = samples[key]
                    parts.append(one.innovation[inside(one.timestamp_sample, airborne) & one.fused])
            if parts and sum(map(len, parts)):
                sizes[group] = rms(parts)
        figures.append(InstanceFigures(instance, shares.get(instance, 0.0), sizes))
    return tuple(figures)
