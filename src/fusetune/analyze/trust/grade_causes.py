"""What keeps a replay from repeating the flight, and what each of these causes costs: found by switching it.

A repair is left out, the start made cold, every second GNSS sample dropped.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from fusetune.analyze.reconstruction import ReconstructedFlight
from fusetune.analyze.reconstruction.between_samples import logged_rate_hz
from fusetune.analyze.reconstruction.reconstructed_flight import BARO, IMU, MAG
from fusetune.analyze.replaying.prepared_flight import PreparedFlight, prepare
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.replaying.start_choice import Start, choose_start
from fusetune.analyze.trust.as_flown_comparison import AsFlownComparison, distance
from fusetune.analyze.trust.as_flown_figures import AsFlownFigures
from fusetune.analyze.trust.log_lacks import FULL_GNSS_RATE_HZ
from fusetune.analyze.trust.words import other_release
from fusetune.check import Check
from fusetune.finding import Finding
from fusetune.px4.flight import TopicTable, row_count, select_rows
from fusetune.save.checks.barometer import barometer
from fusetune.save.checks.flight import log_start
from fusetune.save.checks.gnss import gnss
from fusetune.save.checks.imu import imu_coverage
from fusetune.save.checks.judged_flight import GNSS, JudgedFlight
from fusetune.save.checks.log import firmware
from fusetune.save.checks.magnetometer import magnetometer

REPAIRS = {
    IMU: (imu_coverage, "missing IMU rows"),
    MAG: (magnetometer, "thinned magnetometer"),
    BARO: (barometer, "thinned barometer"),
}
"""What can be made up for: the check of the verdict that tells of it, and the cause in words."""


def cause(asked: Check[JudgedFlight], found: str, cost: float, *, repaired: bool, measured: bool) -> Finding:
    """What keeps the replay from repeating the flight, or would if the replay were not made without it.

    Parameters
    ----------
    asked : the check of the verdict that tells of the same thing, whose id the cause has
    cost : by how much it raises the distance from the vehicle; 1 is the width of the grades A and B
    repaired : whether the replay is made without it
    measured : whether the cost was found by switching the cause; otherwise it is what remains
    """
    evidence = {"repaired": repaired, "measured": measured}
    return Finding(asked.id, "note" if repaired else "warning", found, figure=cost, evidence=evidence)


def cost_of(one: Finding) -> float:
    """What a cause costs."""
    return 0.0 if one.figure is None else one.figure


def causes_of(
    comparison: AsFlownComparison, prepared: PreparedFlight, replay: ReplaySettings, repaired: AsFlownFigures
) -> tuple[Finding, ...]:
    """What keeps, or kept, the replay from repeating the flight, the costliest first.

    Parameters
    ----------
    prepared, replay : the replay in use
    repaired : its figures
    """
    return tuple(sorted(_causes(comparison, prepared, replay, repaired), key=lambda one: -cost_of(one)))


def _causes(
    comparison: AsFlownComparison, prepared: PreparedFlight, replay: ReplaySettings, repaired: AsFlownFigures
) -> Iterator[Finding]:
    flight, reached = comparison.flight, distance(repaired, comparison.settings)
    done = {step.sensor for step in prepared.reconstructed.steps if step.done}
    for topic, (asked, words) in REPAIRS.items():
        if topic in done:
            cost = comparison.distance(without_repair(prepared, replay, topic)) - reached
            yield cause(asked, words, cost, repaired=True, measured=True)
    if prepared.start.state is not None:
        cost = comparison.distance(dataclasses.replace(prepared, start=Start(None, "asked for"))) - reached
        words = "the log begins too late for a start from nothing"
        yield cause(log_start, words, cost, repaired=True, measured=True)
    lost_to_gnss = 0.0
    rate = logged_rate_hz(flight.topic(GNSS))
    if rate is not None and rate < FULL_GNSS_RATE_HZ:
        halved = comparison.distance(with_half_the_gnss(prepared, replay))
        lost_to_gnss = max(halved - reached, 0.0)
        words = f"GNSS logged at {rate:.1f} Hz (cost of halving it once more)"
        yield cause(gnss, words, lost_to_gnss, repaired=False, measured=True)
    if words := other_release(flight, prepared.replayed):
        yield cause(firmware, words, max(reached - lost_to_gnss, 0.0), repaired=False, measured=False)


def without_repair(prepared: PreparedFlight, replay: ReplaySettings, topic: str) -> PreparedFlight:
    """The same flight with one sensor's samples as they were logged."""
    if topic == IMU and replay.reconstruction is not None:
        # what is done about the magnetometer follows from the IMU
        reconstruction = dataclasses.replace(replay.reconstruction, imu=False)
        return prepare(prepared.flight, reconstruction, replay.start, release=prepared.replayed.asked)
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
