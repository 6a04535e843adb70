"""How hard the motors were asked to push, as far as a log tells: in one order and one unit for all who ask."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.px4.flight import Flight, TopicTable, field_names, row_count, stacked

FEWEST_ROWS = 10
MOST_MOTORS = 8


class Throttle(NamedTuple):
    """Share of full throttle.

    Attributes
    ----------
    time : (N,) int64, µs since boot
    share : (N,) 0 to 1
    topic : that tells it
    """

    time: npt.NDArray[np.int64]
    share: npt.NDArray[np.float64]
    topic: str


def throttle(flight: Flight, topics: Collection[str] | None = None) -> Throttle | None:
    """The thrust that was asked for (v1.14 and newer, then older), else what motors or outputs were told; None without.

    Parameters
    ----------
    topics : of `SOURCES`, those that count; all of them if None
    """
    for topic, read in SOURCES.items():
        table = flight.topic(topic) if topics is None or topic in topics else None
        share = None if table is None or row_count(table) < FEWEST_ROWS else read(table)
        if table is not None and share is not None and np.isfinite(share).sum() >= FEWEST_ROWS:
            kept = np.isfinite(share)
            return Throttle(np.asarray(table["timestamp"], np.int64)[kept], share[kept], topic)
    return None


def _of_motors(table: TopicTable) -> npt.NDArray[np.float64] | None:
    return _mean_of_used(stacked(table, "control")) if field_names(table, "control") else None


def _of_outputs(table: TopicTable) -> npt.NDArray[np.float64] | None:
    """Those between 900 and 2200 µs that move: the first outputs are the motors of a multicopter."""
    if not field_names(table, "output"):
        return None
    pwm = stacked(table, "output")[:, :MOST_MOTORS]
    return _mean_of_used(np.where((pwm >= 900.0) & (pwm <= 2200.0), (pwm - 1000.0) / 1000.0, np.nan))


def _of_controls(table: TopicTable) -> npt.NDArray[np.float64] | None:
    return np.asarray(table["control[3]"], np.float64) if "control[3]" in table else None


def _of_setpoint(table: TopicTable) -> npt.NDArray[np.float64] | None:
    return -np.asarray(table["xyz[2]"], np.float64) if "xyz[2]" in table else None


def _mean_of_used(commands: npt.NDArray[np.float64]) -> npt.NDArray[np.float64] | None:
    """Mean over the motors that are commanded throughout and not all the time the same."""
    known = np.isfinite(commands)
    used = [i for i in range(commands.shape[1]) if known[:, i].mean() > 0.5 and np.nanstd(commands[:, i]) > 0.0]
    if not used:
        return None
    chosen = commands[:, used]
    complete = np.isfinite(chosen).all(axis=1)
    return np.where(complete, np.where(np.isfinite(chosen), chosen, 0.0).mean(axis=1), np.nan)


ASKED = ("vehicle_thrust_setpoint", "actuator_controls_0")
"""Of these PX4 takes the throttle that it compensates magnetometers with."""
SOURCES: Mapping[str, Callable[[TopicTable], npt.NDArray[np.float64] | None]] = {
    "vehicle_thrust_setpoint": _of_setpoint,
    "actuator_controls_0": _of_controls,
    "actuator_motors": _of_motors,
    "actuator_outputs": _of_outputs,
}
"""Topic → share of full throttle, the first one that tells counts."""
