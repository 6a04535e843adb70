"""How many samples of each sensor the estimator is given, and why not the others; by the code that gives them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fusetune.ekf2 import message_samples as convert
from fusetune.ekf2.arrival_order import schedule_runs
from fusetune.ekf2.message_samples import Refusal
from fusetune.ekf2.taken_samples import AIDING, TakenSamples
from fusetune.px4.flight import Flight, TopicTable, row_count

NO_NUMBER = convert.NO_NUMBER
"""Reason of messages in which a sensor says itself that it has nothing to say."""


@dataclass(frozen=True)
class GivenSamples:
    """What becomes of the messages of one sensor, or of one part of them.

    Attributes
    ----------
    sensor : an aiding sensor of the estimator's inputs; of vision ``"ev_pos"``, ``"ev_vel"`` and ``"ev_yaw"``
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


def given_samples(flight: Flight) -> dict[str, GivenSamples]:
    """What the estimator is given of every sensor of which the log holds messages, by sensor.

    Parameters
    ----------
    flight : in the layout of `fusetune.px4.release_layouts.canonical`; needs `sensor_combined`

    Raises
    ------
    KeyError
        The flight has no `sensor_combined`.
    """
    runs = schedule_runs(flight)
    return {one.sensor: one for name, take in AIDING.items() for one in _given(flight, name, take(flight, runs))}


def _given(flight: Flight, name: str, taken: TakenSamples) -> Iterator[GivenSamples]:
    release = flight.release
    if name == "ev":
        yield from _vision_parts(flight, taken)
    elif name == "range":
        tables = [flight.topics["distance_sensor", k] for k in flight.instances("distance_sensor")]
        refused = [refusal for table in tables for refusal in convert.range_refusals(table)]
        messages = sum(row_count(table) for table in tables)
        if messages:
            yield GivenSamples(name, "distance_sensor", messages, _arrived(taken), _counted(refused))
    elif name == "airspeed":
        yield from _airspeed(flight, taken)
    else:
        topic = _TOPICS[name]
        table = flight.topic(topic)
        if table is not None and row_count(table):
            refusals: Sequence[Refusal] = ()
            if name == "gnss":
                refusals = convert.gnss_refusals(table, release)
            elif name == "flow":
                refusals = convert.flow_refusals(table)
            elif name == "auxvel":
                refusals = convert.auxvel_refusals(table)
            yield GivenSamples(name, topic, row_count(table), _arrived(taken), _counted(refusals))


_TOPICS = {
    "gnss": "vehicle_gps_position",
    "mag": "vehicle_magnetometer",
    "baro": "vehicle_air_data",
    "flow": "vehicle_optical_flow",
    "auxvel": "landing_target_pose",
}


def _airspeed(flight: Flight, taken: TakenSamples) -> Iterator[GivenSamples]:
    validated, raw = flight.topic("airspeed_validated"), flight.topic("airspeed")
    refusals: list[Refusal] = []
    if validated is not None:
        refusals += convert.validated_airspeed_refusals(validated, flight.release)
    if raw is not None:
        refusals += convert.airspeed_refusals(raw)
    messages = sum(row_count(table) for table in (validated, raw) if table is not None)
    if messages:
        topic = "airspeed" if validated is None else "airspeed_validated"
        yield GivenSamples("airspeed", topic, messages, _arrived(taken), _counted(refusals))


def _vision_parts(flight: Flight, taken: TakenSamples) -> Iterator[GivenSamples]:
    table: TopicTable | None = flight.topic("vehicle_visual_odometry")
    if table is None or not row_count(table):
        return
    arrived = taken.samples[taken.arrival[taken.arrival >= 0]]
    refusals = convert.vision_refusals(table, flight.release)
    for sensor, part, refused in zip(("ev_pos", "ev_vel", "ev_yaw"), ("pos", "vel", "quat"), refusals, strict=True):
        given = int(np.isfinite(arrived[part]).all(axis=1).sum())
        yield GivenSamples(sensor, "vehicle_visual_odometry", row_count(table), given, _counted(refused))


def _arrived(taken: TakenSamples) -> int:
    return int(np.sum(taken.arrival >= 0))


def _counted(refusals: Sequence[Refusal]) -> tuple[tuple[str, int], ...]:
    """Reasons with the number of messages; a message that is refused for several reasons counts for each."""
    counts: dict[str, int] = {}
    for reason, rows in refusals:
        counts[reason] = counts.get(reason, 0) + int(rows.sum())
    return tuple((reason, count) for reason, count in counts.items() if count)
