"""How many samples of each sensor the estimator is given, and why not the others; by the code that gives them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fusetune.ekf2.feed import message_samples as convert
from fusetune.ekf2.feed.arrival_order import schedule_runs
from fusetune.ekf2.feed.message_samples import Refusal
from fusetune.ekf2.feed.taken_samples import AIDING, OfOneTopic, TakenSamples
from fusetune.px4.flight import Flight, TopicKey, TopicTable, row_count

_ORDINARY = (convert.NO_NUMBER, convert.NOT_DOWN, convert.NOT_STATIC)
"""Reasons for which nobody need worry: the sensor says itself that it has nothing to say, or serves something else."""


@dataclass(frozen=True)
class GivenSamples:
    """What becomes of the messages of one sensor, or of one part of them.

    Attributes
    ----------
    sensor : an aiding sensor of the estimator's inputs, and ``"gnss_yaw"``; of vision ``"ev_pos"``, ``"ev_vel"`` and
        ``"ev_yaw"``
    topic : that it is taken from
    messages : that the log holds
    given : samples that reach the estimator; where the log holds more than one message per run of it, the newest
    refused : reason and number of messages that the estimator is not given
    """

    sensor: str
    topic: str
    messages: int
    given: int
    refused: tuple[tuple[str, int], ...] = ()

    @property
    def refusals(self) -> str:
        """Reasons and numbers in words; empty where every message is taken."""
        return ", ".join(f"{rows} {reason}" for reason, rows in self.refused)

    @property
    def is_withheld(self) -> bool:
        """Whether the estimator is given none, though the sensor measured for it."""
        return not self.given and self.messages > sum(rows for reason, rows in self.refused if reason in _ORDINARY)


def given_samples(flight: Flight) -> dict[str, GivenSamples]:
    """What the estimator is given of every sensor of which the log holds messages, by sensor.

    Parameters
    ----------
    flight : in the layout of `fusetune.px4.layouts.release_layouts.canonical`; needs `sensor_combined`

    Raises
    ------
    KeyError
        The flight has no `sensor_combined`.
    """
    runs = schedule_runs(flight)
    return {one.sensor: one for name, take in AIDING.items() for one in _given(flight, name, take(flight, runs))}


def _given(flight: Flight, name: str, samples: TakenSamples) -> Iterator[GivenSamples]:
    if name == "ev":
        yield from _vision_parts(flight, samples)
        return
    topics, refusals = _messages(flight, name)
    messages = sum(row_count(table) for table in topics.values())
    if messages:
        yield GivenSamples(name, next(iter(topics))[0], messages, _arrived(samples), _counted(refusals))
    if messages and name == "gnss":
        given = int(np.isfinite(_arrived_samples(samples)["yaw"]).sum())
        without = int((~np.isfinite(samples.samples["yaw"])).sum())
        refused = (("without a heading", without),) if without else ()
        yield GivenSamples("gnss_yaw", next(iter(topics))[0], messages, given, refused)


def _messages(flight: Flight, name: str) -> tuple[dict[TopicKey, TopicTable], list[Refusal]]:
    """Topics that a sensor's samples are taken from, and which of their messages are refused."""
    if name == "range":
        topics = {key: table for key, table in flight.topics.items() if key[0] == "distance_sensor"}
        return topics, [refusal for table in topics.values() for refusal in convert.range_refusals(table)]
    if name == "airspeed":
        return _airspeed(flight)
    sensor = AIDING[name]
    if not isinstance(sensor, OfOneTopic):
        raise TypeError(f"nothing says which messages of {name!r} are refused")
    table = flight.topic(sensor.topic)
    return ({}, []) if table is None else ({(sensor.topic, 0): table}, sensor.refusals(table, flight.release))


def _airspeed(flight: Flight) -> tuple[dict[TopicKey, TopicTable], list[Refusal]]:
    """Validated airspeed; the raw sensor too where nothing of that is taken."""
    topics: dict[TopicKey, TopicTable] = {}
    refusals: list[Refusal] = []
    validated, raw = flight.topic("airspeed_validated"), flight.topic("airspeed")
    any_taken = False
    if validated is not None and row_count(validated):
        topics["airspeed_validated", 0] = validated
        refusals = convert.validated_airspeed_refusals(validated, flight.release)
        any_taken = bool(convert.taken(validated, refusals).any())
    if raw is not None and not any_taken:
        topics["airspeed", 0] = raw
        refusals = refusals + convert.airspeed_refusals(raw)
    return topics, refusals


def _vision_parts(flight: Flight, samples: TakenSamples) -> Iterator[GivenSamples]:
    table = flight.topic("vehicle_visual_odometry")
    if table is None or not row_count(table):
        return
    arrived = _arrived_samples(samples)
    refusals = convert.vision_refusals(table, flight.release)
    for sensor, part, refused in zip(("ev_pos", "ev_vel", "ev_yaw"), ("pos", "vel", "quat"), refusals, strict=True):
        given = int(np.isfinite(arrived[part]).all(axis=1).sum())
        yield GivenSamples(sensor, "vehicle_visual_odometry", row_count(table), given, _counted(refused))


def _arrived(samples: TakenSamples) -> int:
    return int(np.sum(samples.arrival >= 0))


def _arrived_samples(samples: TakenSamples) -> np.ndarray:
    return samples.samples[samples.arrival[samples.arrival >= 0]]


def _counted(refusals: Sequence[Refusal]) -> tuple[tuple[str, int], ...]:
    """Reasons with the number of messages; a message that is refused for several reasons counts for each."""
    counts: dict[str, int] = {}
    for reason, rows in refusals:
        counts[reason] = counts.get(reason, 0) + int(rows.sum())
    return tuple((reason, count) for reason, count in counts.items() if count)
