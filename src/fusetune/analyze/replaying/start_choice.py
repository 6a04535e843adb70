"""Whether a replay starts from the vehicle's own state (warm) or from nothing (cold)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusetune.analyze.replaying.settings import StartSettings
from fusetune.px4.flight import Flight, TopicTable, row_count
from fusetune.px4.flown_parameters import flown_parameters
from fusetune.px4.layouts.estimator_instances import rows_of_primary
from fusetune.px4.layouts.logged_state import LOGGED_STATE_TOPICS, LoggedState, logged_states, why_no_state

AUTO, WARM, COLD = "auto", "warm", "cold"
START_TOPICS = (*LOGGED_STATE_TOPICS, "sensor_combined", "vehicle_land_detected", "vehicle_gps_position")
"""What the choice reads of a flight."""

BUFFER_FILL_US = 20_000
"""The horizon can reach a state once the IMU samples around it have come in."""


@dataclass(frozen=True)
class Start:
    """How a replay starts, and why; `state` is None for a cold start."""

    state: LoggedState | None
    why: str

    @property
    def mode(self) -> str:
        return COLD if self.state is None else WARM


def choose_start(flight: Flight, settings: StartSettings | None = None) -> Start:
    """Choose how the replays of a flight start; it is the same for all parameter sets.

    A cold start repeats what the vehicle did when it was switched on, and needs time on the ground: 10 s of GNSS
    checks, and as much again to align and to learn the IMU's biases. Where the log gives less than `cold_needs_s`, the
    filter starts from the first logged state in which tilt and heading are aligned and, if the vehicle ever used it,
    GNSS is in use. A log that holds the start of the vehicle's own estimator is started cold however soon it took off:
    a state right after the alignment has none of the correlations that come with it.

    Parameters
    ----------
    flight : in the layout of `fusetune.px4.layouts.release_layouts.canonical`
    """
    settings = settings or StartSettings()
    imu = flight.topic("sensor_combined")
    if settings.mode == COLD or imu is None or not row_count(imu):
        return Start(None, "asked for")
    begin = int(imu["timestamp"][0])
    on_ground_s = _seconds_before_take_off(flight, begin)
    if settings.mode == AUTO and on_ground_s is not None and on_ground_s >= settings.cold_needs_s:
        return Start(None, f"the log begins {on_ground_s:.0f} s before take-off")
    aligned_s = _aligned_after_s(flight, begin)
    if settings.mode == AUTO and aligned_s is not None:
        return Start(None, f"the vehicle's own estimator aligned {aligned_s:.1f} s after the log began")
    state = first_usable_state(flight, begin + BUFFER_FILL_US)
    if state is None:
        return Start(None, _why_none(flight, begin + BUFFER_FILL_US))
    after_s = (state.time_us - begin) * 1e-6
    if settings.mode == AUTO and after_s > settings.warm_within_s:
        return Start(None, f"the vehicle's own estimator was ready only {after_s:.0f} s after the log began")
    return Start(state, f"from the vehicle's own state {after_s:.1f} s after the log began")


def first_usable_state(flight: Flight, since: int) -> LoggedState | None:
    """First logged state that is aligned and uses GNSS, where the vehicle uses it at all."""
    aligned = None
    for state in logged_states(flight, since):
        if state.is_aligned:
            aligned = aligned or state
            if state.uses_gnss:
                return state
    return aligned


def _aligned_after_s(flight: Flight, begin: int) -> float | None:
    """When the vehicle's own estimator aligned within the log, such that a start from nothing comes to the same.

    None where it was aligned before, or not on the ground, or where it used GNSS so soon that the checks of that had
    been passed before the log began.
    """
    flags = rows_of_primary(flight, "estimator_status_flags")
    if flags is None or not {"cs_tilt_align", "cs_yaw_align"} <= flags.keys():
        return None
    aligned = np.flatnonzero((flags["cs_tilt_align"] != 0) & (flags["cs_yaw_align"] != 0))
    if not len(aligned) or aligned[0] == 0:
        return None
    after_s = _since_s(flags, int(aligned[0]), begin)
    used = [np.flatnonzero(flags[name] != 0) for name in ("cs_gnss_pos", "cs_gnss_vel") if name in flags]
    uses = [int(rows[0]) for rows in used if len(rows)]
    needed_s = flown_parameters(flight)["EKF2_REQ_GPS_H"]
    if uses and _since_s(flags, min(uses), begin) < needed_s:
        return None
    on_ground_s = _seconds_before_take_off(flight, begin)
    return after_s if on_ground_s is None or after_s <= on_ground_s else None


def _since_s(table: TopicTable, row: int, begin: int) -> float:
    return float(table["timestamp"][row] - begin) * 1e-6


def _why_none(flight: Flight, since: int) -> str:
    """Why no logged state can be started from: none can be read, or none is that of an aligned estimator."""
    unreadable = why_no_state(flight)
    if unreadable:
        return unreadable
    state = next(logged_states(flight, since), None)
    if state is None:
        return "the vehicle's own estimator logged no state after the first IMU samples"
    if not flight.has("estimator_status_flags"):
        return "the log does not tell whether the vehicle's own estimator was aligned"
    return "the log holds no state of an aligned estimator"


def _seconds_before_take_off(flight: Flight, begin: int) -> float | None:
    """Time on the ground at the beginning of the log; None where the log does not tell."""
    land = flight.topic("vehicle_land_detected")
    if land is None or "landed" not in land or not row_count(land):
        return None
    flying = np.flatnonzero(land["landed"] == 0)
    if not len(flying):
        return float(land["timestamp"][-1] - begin) * 1e-6
    return max(float(land["timestamp"][flying[0]] - begin) * 1e-6, 0.0)
