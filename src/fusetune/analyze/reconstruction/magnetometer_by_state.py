"""The noise of the magnetometer samples that a thinned log lacks, by the states of the vehicle's filter.

The vehicle's filter keeps what the noise of some thousand samples has done to its heading and to its field. Smoothed
samples have none of that noise, so a replay of them ends up with a slightly other heading and field. But the vehicle
logs both: between two logged states the replay departs by the mean noise of the samples in between, times what the
filter's gains make of it. That mean is found and given back to the reconstructed samples.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.replay.following import Departure, follow
from fusetune.px4.flight import Flight, TopicTable, stacked
from fusetune.px4.layouts.logged_state import LoggedState

MAG = "vehicle_magnetometer"
PASSES = 2
"""The filter's reaction is worked out with the covariance of one moment; a second pass makes up for that."""

MIN_INTERVAL_US, MAX_INTERVAL_US = 400_000, 2_000_000
"""Default profiles log one or two states a second; of more, some are left out."""

REACTION_ERROR = 0.05
"""Of the reaction, by which it may be wrong."""

HEADING_ERROR, FIELD_ERROR = 3e-4, 2e-6
"""rad and Gauss: what lost IMU rows do to heading within a second, and what the field departs by for no reason."""

MAX_SHIFT = 4.0
"""Standard deviations: a larger mean of noise is none, but a reset, or a filter of another kind."""

MIN_EXPLAINED = 0.8
MIN_NOISE_GAUSS = 1e-5
OBSERVATION_VARIANCE_MIN = 1e-4
"""Gauss²; EKF2 takes no smaller one (0.01 Gauss)."""


@dataclass(frozen=True)
class Noise:
    """The table, and in how many of the intervals between logged states noise explains the departure.

    Where too few are explained, whatever those to come show, they are not looked at.
    """

    table: TopicTable
    explained: int
    intervals: int

    @property
    def used(self) -> bool:
        """Whether the vehicle's filter reacts as the replay does, so that the noise was given back."""
        return self.intervals > 0 and _are_enough(self.explained, self.intervals)


def add_noise_by_state(
    flight: Flight,
    measured: np.ndarray,
    parameters: Mapping[str, float],
    states: Sequence[LoggedState],
    start: LoggedState | None,
) -> Noise:
    """Give the reconstructed samples the mean noise that led the vehicle's filter to the states it logged.

    Parameters
    ----------
    flight : with reconstructed topics; it is not changed
    measured : (N,) of each row of `vehicle_magnetometer`, whether the log holds it
    parameters : complete, as flown
    states : of the vehicle's filter, in order of time
    start : what replays of the flight start from; None for a cold start
    """
    table = flight.topics[MAG, 0]
    noise = noise_of_measured(stacked(table, "magnetometer_ga"), measured)
    nothing = Noise(table, 0, 0)
    if noise < MIN_NOISE_GAUSS or not states:
        return nothing
    states = _apart(states)
    found = nothing
    for _ in range(PASSES):
        found = _one_pass(
            flight.with_topics(flight.topics | {(MAG, 0): found.table}), measured, parameters, states, start, noise
        )
        if not found.used:
            return Noise(table, found.explained, found.intervals)
    return found


def _are_enough(explained: int, intervals: int) -> bool:
    return explained >= MIN_EXPLAINED * intervals


def noise_of_measured(field: np.ndarray, measured: np.ndarray) -> float:
    """Standard deviation of the noise, Gauss: what a measured sample is off the smoothed ones on both sides of it."""
    alone = np.flatnonzero(measured[1:-1] & ~measured[:-2] & ~measured[2:]) + 1
    if len(alone) < 2:
        return 0.0
    off = field[alone] - 0.5 * (field[alone - 1] + field[alone + 1])
    return float(np.sqrt(np.mean(off**2)))


def _apart(states: Sequence[LoggedState]) -> list[LoggedState]:
    kept: list[LoggedState] = []
    for state in states:
        if not kept or state.time_us - kept[-1].time_us >= MIN_INTERVAL_US:
            kept.append(state)
    return kept


def _one_pass(
    flight: Flight,
    measured: np.ndarray,
    parameters: Mapping[str, float],
    states: Sequence[LoggedState],
    start: LoggedState | None,
    noise: float,
) -> Noise:
    table = dict(flight.topics[MAG, 0])
    fused = table["timestamp_sample"].astype(np.int64) - round(parameters["EKF2_MAG_DELAY"] * 1e3)
    variance = max(parameters["EKF2_MAG_NOISE"] ** 2, OBSERVATION_VARIANCE_MIN)
    shift = np.zeros((len(fused), 3))
    explained = intervals = 0
    times = [state.time_us for state in states]
    for departure, within in _intervals(follow(build_inputs(flight), parameters, states, start), fused):
        missing = within & ~measured
        samples, lacking = int(within.sum()), int(missing.sum())
        if not lacking:
            continue
        reaction = reaction_to_offset(departure, samples, variance) * (lacking / samples)
        deviation = noise / np.sqrt(lacking)
        mean = most_likely_offset(reaction, departure, deviation)
        intervals += 1
        if np.sqrt(np.mean(mean**2)) <= MAX_SHIFT * deviation:
            explained += 1
            shift[missing] = mean
        left = len(times) - bisect_right(times, departure.until)
        if not _are_enough(explained + left, intervals + left):
            break
    for axis in range(3):
        name = f"magnetometer_ga[{axis}]"
        table[name] = (table[name] + shift[:, axis]).astype(table[name].dtype)
    return Noise(table, explained, intervals)


def _intervals(departures: Iterator[Departure], fused: np.ndarray) -> Iterator[tuple[Departure, np.ndarray]]:
    """Departures over a short time, and the samples that were fused in it."""
    for departure in departures:
        if departure.since and departure.until - departure.since <= MAX_INTERVAL_US:
            yield departure, (fused > departure.since) & (fused <= departure.until)


def reaction_to_offset(departure: Departure, samples: int, variance: float) -> np.ndarray:
    """Change (7, 3) of heading, earth field and body field per Gauss that each of some samples is off in the body.

    The Kalman filter's gain for the magnetometer alone, linearised at the end of the interval: samples that are off
    alike act as their mean does, whose variance is theirs over their number. A small rotation θ in NED changes the
    field seen in the body, Rᵀ m, by Rᵀ (m × θ).
    """
    m = departure.field
    cross = np.array([[0.0, -m[2], m[1]], [m[2], 0.0, -m[0]], [-m[1], m[0], 0.0]])
    to_body = departure.to_earth.T
    jacobian = np.concatenate([to_body @ cross, to_body, np.eye(3)], axis=1)
    gain_of_error = departure.covariance @ jacobian.T
    expected = jacobian @ gain_of_error + variance / samples * np.eye(3)
    reaction = np.linalg.solve(expected, gain_of_error.T).T
    if not departure.turns_attitude:
        reaction[:3] = 0.0
    return reaction[2:]


def most_likely_offset(reaction: np.ndarray, departure: Departure, deviation: float) -> np.ndarray:
    """Mean (3,) of noise, Gauss, of standard deviation `deviation` before, given what the replay departs by."""
    observed = np.concatenate([[departure.heading], departure.mag_earth, departure.mag_body])
    floor = np.array([HEADING_ERROR, *[FIELD_ERROR] * 6])
    scale = REACTION_ERROR * deviation * np.linalg.norm(reaction, axis=1) + floor
    weighted = reaction / scale[:, None]
    information = weighted.T @ weighted + np.eye(3) / deviation**2
    return np.linalg.solve(information, weighted.T @ (observed / scale))
