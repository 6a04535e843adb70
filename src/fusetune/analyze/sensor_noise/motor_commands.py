"""How hard the motors were asked to turn, as far as a log tells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.px4.flight import Flight, TopicTable, field_names, row_count, stacked

FEWEST_ROWS = 10
MOST_MOTORS = 8


class MotorCommand(NamedTuple):
    """Mean command of the motors that turn.

    Attributes
    ----------
    time : (N,) int64, µs since boot
    throttle : (N,) 0 to 1; of PWM outputs, microseconds from 1000 to 2000
    """

    time: npt.NDArray[np.int64]
    throttle: npt.NDArray[np.float64]


def motor_command(flight: Flight) -> MotorCommand | None:
    """From `actuator_motors` (v1.13 and newer), the PWM outputs, or the thrust that was asked for; None without any."""
    for topic, read in (
        ("actuator_motors", _of_motors),
        ("actuator_outputs", _of_outputs),
        ("actuator_controls_0", _of_controls),
        ("vehicle_thrust_setpoint", _of_setpoint),
    ):
        table = flight.topic(topic)
        throttle = None if table is None or row_count(table) < FEWEST_ROWS else read(table)
        if table is not None and throttle is not None and np.isfinite(throttle).sum() >= FEWEST_ROWS:
            kept = np.isfinite(throttle)
            return MotorCommand(np.asarray(table["timestamp"], np.int64)[kept], throttle[kept])
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
