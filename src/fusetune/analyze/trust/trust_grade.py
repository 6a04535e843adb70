"""How far the replay of one flight can be trusted: a grade from A to D, and what costs most.

The parameters that flew are replayed and compared with what the vehicle's own estimator logged, as the log is and after
reconstruction. Each figure of the comparison has a grade; the worst is the flight's, and what could not be compared
limits it. What a cause costs is measured by switching it: a repair is left out, the start made cold, every second GNSS
sample dropped.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fusetune.analyze.flight.intervals import Cut, Interval, inside, subtract
from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.reconstruction import RECONSTRUCTION_TOPICS, ReconstructedFlight
from fusetune.analyze.reconstruction.between_samples import logged_rate_hz
from fusetune.analyze.reconstruction.reconstructed_flight import BARO, IMU, MAG
from fusetune.analyze.replaying.onboard import INNOVATION_TOPICS, onboard_samples
from fusetune.analyze.replaying.prepared_flight import PreparedFlight, prepare
from fusetune.analyze.replaying.replay_settings import IN_USE, ReplaySettings
from fusetune.analyze.replaying.start_choice import START_TOPICS, Start, choose_start
from fusetune.analyze.sources import HORIZONTAL_AIDING
from fusetune.analyze.trust.as_flown_figures import AsFlownFigures, as_flown_figures, compared_rows
from fusetune.analyze.trust.compared_innovations import GROUPS, rms
from fusetune.analyze.trust.trust_settings import FALLING, FIGURES, TrustSettings
from fusetune.analyze.trust.trust_words import limits_in_words, not_compared_in_words
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.filter.common.parameters import complete
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.px4.flight import Flight, TopicTable, row_count, select_rows
from fusetune.px4.layouts.estimator_instances import instance_shares
from fusetune.px4.parameters.ekf2_parameters import BASELINE_RELEASE

GRADES = "ABCD"
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

COLD_WARM_UP_US = 10_000_000
FULL_GNSS_RATE_HZ = 4.5
GNSS = "vehicle_gps_position"
REPAIRS = {IMU: "missing IMU rows", MAG: "thinned magnetometer", BARO: "thinned barometer"}


@dataclass(frozen=True)
class Cause:
    """What keeps, or kept, the replay from repeating the flight.

    Attributes
    ----------
    cause : in words
    repaired : whether the replay is made without it
    measured : whether `cost` was found by switching the cause; otherwise it is what remains
    cost : by how much it raises the distance from the vehicle; 1 is the width of the grades A and B
    """

    cause: str
    repaired: bool
    measured: bool
    cost: float


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
    """What limits the grade, and what costs most of what could not be repaired; empty for an A."""
    start: str
    as_logged_grade: str
    as_logged: AsFlownFigures
    repaired: AsFlownFigures
    is_compared: bool
    """Whether the log held anything that speaks for the replay, or against it."""
    figure_grades: dict[str, str]
    not_compared: tuple[str, ...]
    """Figures that the log does not let be compared."""
    causes: tuple[Cause, ...]
    instances: tuple[InstanceFigures, ...]


class AsFlownReplay(NamedTuple):
    """A replay of the parameters that flew, of which `as_flown_figures.compared_rows` were kept."""

    result: ReplayResult
    measured: np.ndarray
    """Whether the sample of each innovation stands in the log."""


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


def distance(figures: AsFlownFigures, settings: TrustSettings) -> float:
    """How far a replay is from the vehicle: mean of the figures, each as a share of the limit of grade B."""
    shares = []
    if figures.innovation_factor is not None:
        shares.append(math.log(figures.innovation_factor) / math.log(settings.innovation_factor[1]))
    for name in ("velocity_m_s", "heading_deg", "height_m", "vertical_velocity_m_s"):
        if getattr(figures, name) is not None:
            shares.append(getattr(figures, name) / getattr(settings, name)[1])
    for name in FALLING:
        if getattr(figures, name) is not None:
            shares.append((1.0 - getattr(figures, name)) / (1.0 - getattr(settings, name)[1]))
    return float(np.mean(shares)) if shares else math.nan


def grade_flight(
    prepared: PreparedFlight,
    replay: ReplaySettings = IN_USE,
    settings: TrustSettings | None = None,
    as_flown: AsFlownReplay | None = None,
) -> TrustGrade:
    """Grade one flight.

    Parameters
    ----------
    prepared : with `TRUST_TOPICS`
    replay : as it was prepared
    as_flown : of the parameters that flew, where they have been replayed already
    """
    settings, flight = settings or TrustSettings(), prepared.flight
    comparison = _Comparison(flight, settings)
    prepared = dataclasses.replace(prepared, gaps=())
    repaired = comparison.figures(prepared, as_flown)
    raw = comparison.figures(_as_logged(flight, prepared, replay))
    graded = grade_of(repaired, settings)
    causes: tuple[Cause, ...] = ()
    if settings.causes and math.isfinite(distance(repaired, settings)):
        causes = tuple(sorted(_causes(comparison, prepared, replay, repaired), key=lambda c: -c.cost))
    return TrustGrade(
        grade=graded.grade,
        words=GRADE_WORDS[graded.grade],
        reason=_reason(graded, repaired, causes),
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


def _reason(graded: Graded, figures: AsFlownFigures, causes: tuple[Cause, ...]) -> str:
    """Why the grade is no A: the figures that have it, those that could not be compared, and the largest cause."""
    if graded.grade == "A":
        return ""
    if not graded.is_compared:
        return "the log holds nothing of the vehicle's own estimator that could be compared"
    parts = limits_in_words(figures, [name for name, one in graded.figure_grades.items() if one == graded.grade])
    if graded.not_compared:
        parts.append(not_compared_in_words(graded.not_compared))
    parts += [cause.cause for cause in causes if not cause.repaired and cause.cost > 0.0][:1]
    return "; ".join(parts)


def _as_logged(flight: Flight, prepared: PreparedFlight, replay: ReplaySettings) -> PreparedFlight:
    """The flight as the log is, replayed from nothing; where nothing was missing, with the samples of `prepared`."""
    if replay.reconstruction is None or prepared.reconstructed.changed:
        return prepare(flight)
    return dataclasses.replace(prepared, start=Start(None, "asked for"), handovers=())


class _Comparison:
    """Replays of the parameters that flew against the log, all over the same part of the flight."""

    def __init__(self, flight: Flight, settings: TrustSettings):
        self.flight, self.settings = flight, settings
        self.params = complete(flight.parameters.initial, {}, flight.release)
        self.onboard = onboard_samples(flight)
        self.intervals: tuple[Interval, ...] | None = None
        self.done: list[tuple[PreparedFlight, AsFlownFigures]] = []
        """Replays of the samples in use; others are not worth their memory."""

    def figures(self, prepared: PreparedFlight, done: AsFlownReplay | None = None) -> AsFlownFigures:
        """Figures of one replay; the first one, which is the one in use, decides which part is compared.

        Parameters
        ----------
        done : the replay, where it has been made already
        """
        for other, figures in self.done:
            if _is_same_course(prepared, other):
                return figures
        result, measured = done or prepared.replay(self.params, keep=compared_rows(self.onboard))
        if self.intervals is None:
            self.intervals = self._compared(result)
        figures = as_flown_figures(result, measured, self.flight, self.intervals, self.onboard)
        if not self.done or prepared.inputs is self.done[0][0].inputs:
            self.done.append((prepared, figures))
        return figures

    def distance(self, prepared: PreparedFlight) -> float:
        return distance(self.figures(prepared), self.settings)

    def _compared(self, result: ReplayResult) -> tuple[Interval, ...]:
        settle_us = round(self.settings.settle_s * 1e6)
        if result.warm_start_us is not None:
            begin = result.warm_start_us + settle_us
        else:
            sources = [AID_SOURCE_NAMES.index(name) for name in HORIZONTAL_AIDING if name in AID_SOURCE_NAMES]
            fused = result.innovations["fused"] & np.isin(result.innovations["source"], sources)
            # a filter without horizontal aid settles from its start
            times = result.innovations["timestamp_sample"][fused] if fused.any() else result.states["timestamp_sample"]
            begin = int(times.min(initial=2**62)) + settle_us + COLD_WARM_UP_US
        return subtract(airborne_intervals(self.flight, {}), [Cut(-(2**62), begin, "warm-up")])


def _is_same_course(one: PreparedFlight, other: PreparedFlight) -> bool:
    """Whether two prepared flights give the same replay, as where the one in use starts from nothing anyway."""
    same = ((one.inputs, other.inputs), (one.start.state, other.start.state), (one.handovers, other.handovers))
    return all(left is right for left, right in same)


def _causes(
    comparison: _Comparison, prepared: PreparedFlight, replay: ReplaySettings, repaired: AsFlownFigures
) -> Iterator[Cause]:
    flight, reached = comparison.flight, distance(repaired, comparison.settings)
    done = {step.sensor for step in prepared.reconstructed.steps if step.done}
    for topic, words in REPAIRS.items():
        if topic in done:
            yield Cause(words, True, True, comparison.distance(without_repair(prepared, replay, topic)) - reached)
    if prepared.start.state is not None:
        cost = comparison.distance(dataclasses.replace(prepared, start=Start(None, "asked for"))) - reached
        yield Cause("the log begins too late for a start from nothing", True, True, cost)
    lost_to_gnss = 0.0
    rate = logged_rate_hz(flight.topic(GNSS))
    if rate is not None and rate < FULL_GNSS_RATE_HZ:
        halved = comparison.distance(with_half_the_gnss(prepared, replay))
        lost_to_gnss = max(halved - reached, 0.0)
        yield Cause(f"GNSS logged at {rate:.1f} Hz (cost of halving it once more)", False, True, lost_to_gnss)
    if flight.release is not None and flight.release[:2] != BASELINE_RELEASE:
        baseline = "v{}.{}".format(*BASELINE_RELEASE)
        words = f"the vehicle flew {flight.release_name}, the replay behaves like {baseline}"
        yield Cause(words, False, False, max(reached - lost_to_gnss, 0.0))


def without_repair(prepared: PreparedFlight, replay: ReplaySettings, topic: str) -> PreparedFlight:
    """The same flight with one sensor's samples as they were logged."""
    if topic == IMU and replay.reconstruction is not None:
        # what is done about the magnetometer follows from the IMU
        return prepare(prepared.flight, dataclasses.replace(replay.reconstruction, imu=False), replay.start)
    reconstructed = prepared.reconstructed
    measured = {name: mask for name, mask in reconstructed.measured.items() if name != topic}
    return prepared.with_stream(_with_table(reconstructed, topic, prepared.flight.topics[topic, 0], measured))


def with_half_the_gnss(prepared: PreparedFlight, replay: ReplaySettings) -> PreparedFlight:
    """The same flight without every second sample of GNSS."""
    table = prepared.flight.topics[GNSS, 0]
    half = select_rows(table, np.arange(0, row_count(table), 2))
    reconstructed = prepared.reconstructed
    halved = prepared.with_stream(_with_table(reconstructed, GNSS, half, reconstructed.measured))
    if replay.start is None:
        return halved
    # whether a logged state can be taken over may depend on the samples of GNSS
    flight = prepared.flight.with_topics(prepared.flight.topics | {(GNSS, 0): half})
    return dataclasses.replace(halved, start=choose_start(flight, replay.start))


def _with_table(
    reconstructed: ReconstructedFlight, topic: str, table: TopicTable, measured: dict[str, np.ndarray]
) -> ReconstructedFlight:
    flight = reconstructed.flight.with_topics(reconstructed.flight.topics | {(topic, 0): table})
    return dataclasses.replace(reconstructed, flight=flight, measured=measured)


def _instances(flight: Flight) -> tuple[InstanceFigures, ...]:
    """Innovations of every estimator instance of the vehicle, while it flew."""
    shares = instance_shares(flight)
    airborne = airborne_intervals(flight, {})
    topics = [name for name, _ in flight.topics if name.startswith("estimator_aid_src_")]
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
