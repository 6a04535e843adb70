"""Manoeuvre classes of a path made by hand, and of the simulated survey."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from tests.analyze.conformance.made_track import track_of

from fusetune.analyze.conformance.flown_track import STEP_US, flown_track
from fusetune.analyze.conformance.manoeuvres import manoeuvres
from fusetune.px4.flight import Flight

STEP_S = STEP_US * 1e-6
PARTS = (
    # seconds, and velocity north, east, down in m/s, or turning rate in degrees/s at 5 m/s
    ("ground", 6.0, (0.0, 0.0, 0.0)),
    ("takeoff", 8.0, (0.0, 0.0, -1.5)),
    ("hover", 6.0, (0.0, 0.0, 0.0)),
    ("straight", 10.0, (5.0, 0.0, 0.0)),
    ("turn", 6.0, 30.0),
    ("straight", 8.0, (-5.0, 0.0, 0.0)),
    ("climb", 6.0, (0.0, 0.0, -2.0)),
    ("hover", 5.0, (0.0, 0.0, 0.0)),
    ("descent", 6.0, (0.0, 0.0, 1.0)),
    ("hover", 5.0, (0.0, 0.0, 0.0)),
    ("landing", 9.0, (0.0, 0.0, 2.0)),
    ("ground", 6.0, (0.0, 0.0, 0.0)),
)


def made_velocity(gusts: float) -> tuple[np.ndarray, list[float]]:
    """Velocity (N, 3), and when each part begins, s."""
    rows, edges = [], [0.0]
    for _, seconds, how in PARTS:
        steps = round(seconds / STEP_S)
        if isinstance(how, float):
            angle = np.radians(how) * STEP_S * np.arange(steps)
            rows.append(np.column_stack([5.0 * np.cos(angle), 5.0 * np.sin(angle), np.zeros(steps)]))
        else:
            rows.append(np.tile(how, (steps, 1)))
        edges.append(edges[-1] + steps * STEP_S)
    velocity = np.vstack(rows)
    phase = STEP_S * np.arange(len(velocity))[:, None] * np.array([1.9, 2.3, 1.4])
    aloft = (phase[:, :1] > 1.9 * edges[1]) & (phase[:, :1] < 1.9 * edges[-2])
    return velocity + aloft * gusts * np.sin(phase), edges


def test_each_part_of_a_made_flight_is_what_it_is_also_in_gusts() -> None:
    for gusts in (0.0, 0.2):
        velocity, edges = made_velocity(gusts)
        airborne = ((round(1e6 * edges[1]) + STEP_US, round(1e6 * edges[-2]) + STEP_US),)
        track = replace(track_of(STEP_S * np.cumsum(velocity, axis=0), airborne), velocity=velocity)
        found = manoeuvres(track)
        assert [one.kind for one in found] == [kind for kind, _, _ in PARTS]
        starts = [one.start * 1e-6 - STEP_S for one in found]
        # the second over which velocities are averaged, and a gust
        assert np.abs(np.subtract(starts, edges[:-1])).max() < 1.5


def test_the_moments_of_a_flight_follow_each_other_without_a_gap_or_an_overlap(survey_flight: Flight) -> None:
    track = flown_track(survey_flight)
    assert track is not None
    assert track.source == "estimate"
    found = manoeuvres(track)
    assert all(one.stop == other.start for one, other in pairwise(found))
    assert (found[0].start, found[-1].stop) == (int(track.time[0]), int(track.time[-1]) + STEP_US)
    assert {one.kind for one in found} >= {"ground", "takeoff", "hover", "straight", "turn", "landing"}
    assert min(one.seconds for one in found if one.kind != "ground") >= 1.0


def test_turning_on_the_spot_is_a_turn() -> None:
    still = np.zeros((400, 3)) - np.array([0.0, 0.0, 20.0])
    heading = np.radians(np.interp(np.arange(400), [150, 250], [0.0, 180.0]))
    found = manoeuvres(replace(track_of(still), heading=heading))
    assert [one.kind for one in found] == ["hover", "turn", "hover", "ground"]
    assert abs(found[1].seconds - 5.0) < 1.5
