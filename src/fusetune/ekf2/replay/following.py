"""Follow the vehicle's own filter: replay a flight, and come back to each state that the vehicle logged.

Between two logged states the replay departs from the vehicle by what it is fed otherwise. Since it is put back each
time, a departure tells of the samples of its own interval only.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fusetune.ekf2.feed.inputs import EstimatorInputs
from fusetune.ekf2.filter.common.state import ATTITUDE, MAG_BODY, MAG_EARTH
from fusetune.ekf2.replay.replay import begin_course
from fusetune.ekf2.replay.warm_start import quaternion_product
from fusetune.px4.layouts.logged_state import LoggedState
from fusetune.quaternions import rotation_matrix

FIELD_STATES = np.r_[ATTITUDE : ATTITUDE + 3, MAG_EARTH : MAG_EARTH + 3, MAG_BODY : MAG_BODY + 3]
"""Error states that the magnetometer moves at once: attitude (3), earth field (3), body field (3)."""


@dataclass(frozen=True)
class Departure:
    """From one logged state to the next, where both filters know their heading and the field.

    Attributes
    ----------
    since, until : fusion time horizon at the two states, µs
    heading : vehicle less replay, rad, about the axis that points down
    mag_earth, mag_body : (3,) vehicle less replay, Gauss
    covariance : (9, 9) of `FIELD_STATES` at `since`
    to_earth : (3, 3) body to NED at `until`
    field : (3,) earth field of the replay at `until`, NED, Gauss
    turns_attitude : whether the magnetometer moved the attitude too, and not the field alone
    """

    since: int
    until: int
    heading: float
    mag_earth: np.ndarray
    mag_body: np.ndarray
    covariance: np.ndarray
    to_earth: np.ndarray
    field: np.ndarray
    turns_attitude: bool


def follow(
    inputs: EstimatorInputs,
    parameters: Mapping[str, float],
    states: Iterable[LoggedState],
    start: LoggedState | None = None,
) -> Iterator[Departure]:
    """Replay a flight along the heading and the field that the vehicle logged.

    Parameters
    ----------
    inputs, parameters, start : as for `fusetune.ekf2.replay.replay`; the parameters are those that flew
    states : of the vehicle, in order of time
    """
    course, run, warm_start_us = begin_course(inputs, parameters, start=start)
    ekf = course.ekf[0]
    since = warm_start_us or 0
    for state in states:
        if state.time_us <= since:
            continue
        covariance = ekf["P"][np.ix_(FIELD_STATES, FIELD_STATES)].copy()
        run = course.reach(run, state.time_us)
        until = int(ekf["time_delayed_us"])
        if until < state.time_us:
            return
        if ekf["cs"]["yaw_align"] and state.is_aligned and state.mag_earth.any() and ekf["mag_I"].any():
            departure = _departure(ekf, state, since, until, covariance)
            yield departure
            _return_to(ekf, state, departure.heading)
        since = until


def _departure(ekf: np.void, state: LoggedState, since: int, until: int, covariance: np.ndarray) -> Departure:
    to_earth = np.array(ekf["R_to_earth"], np.float64)
    # of a small rotation θ between the two attitudes the skew part is [θ]ₓ
    between = rotation_matrix(state.q) @ to_earth.T
    return Departure(
        since=since,
        until=until,
        heading=math.atan2(between[1, 0] - between[0, 1], between[0, 0] + between[1, 1]),
        mag_earth=state.mag_earth - ekf["mag_I"],
        mag_body=state.mag_body - ekf["mag_B"],
        covariance=covariance,
        to_earth=to_earth,
        field=np.array(ekf["mag_I"], np.float64),
        turns_attitude=bool(ekf["cs"]["mag_3d"] or ekf["cs"]["mag_hdg"]),
    )


def _return_to(ekf: np.void, state: LoggedState, heading: float) -> None:
    turn = np.array([math.cos(0.5 * heading), 0.0, 0.0, math.sin(0.5 * heading)])
    q = quaternion_product(turn, np.array(ekf["q"], np.float64))
    ekf["q"] = q
    ekf["R_to_earth"] = rotation_matrix(q)
    ekf["mag_I"], ekf["mag_B"] = state.mag_earth, state.mag_body
