"""Gaps in which a sensor is withheld: the filter learns nothing of it, and the replay around them nothing of a gap."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.filter.common.parameters import complete
from fusetune.ekf2.replay.replay import replay
from fusetune.ekf2.replay.results import Gap, ReplayResult
from fusetune.px4.flight import Flight

START, STOP = 45_000_000, 54_000_000
"""In flight: the simulated vehicle takes off some 15 s after the log begins (µs after its first sample)."""

MEASURED = {
    "gnss": ("vehicle_gps_position", "vel_e_m_s", "gnss_vel", 1, 0.5),
    "baro": ("vehicle_air_data", "baro_alt_meter", "baro_hgt", 0, 1.0),
    "mag": ("vehicle_magnetometer", "magnetometer_ga[1]", "mag", 1, 0.03),
}
"""Sensor → topic and field, aid source and axis, and by how much the field is shifted."""


@pytest.fixture(scope="module")
def flight(survey_flight) -> Flight:
    return survey_flight


def replayed(flight: Flight, *gaps: Gap) -> ReplayResult:
    return replay(build_inputs(flight), complete(flight.parameters.initial, {}, flight.release), gaps=gaps)


def gap_of(flight: Flight, sensor: str, start: int = START, stop: int = STOP) -> Gap:
    first = int(flight.topics["sensor_combined", 0]["timestamp"][0])
    return Gap(sensor, first + start, first + stop)


def shifted(flight: Flight, sensor: str, gap: Gap) -> Flight:
    """The same flight, but from two seconds after the beginning of the gap the sensor measures something else."""
    topic, field, _, _, shift = MEASURED[sensor]
    table = dict(flight.topics[topic, 0])
    values = table[field].copy()
    values[table["timestamp"] >= gap.start + 2_000_000] += shift
    return dataclasses.replace(flight, topics=flight.topics | {(topic, 0): table | {field: values}})


def innovations(rows: np.ndarray, source: str, axis: int) -> np.ndarray:
    return rows[(rows["source"] == AID_SOURCE_NAMES.index(source)) & (rows["axis"] == axis)]


def test_gaps_leave_the_replay_as_it_is(flight):
    gaps = [gap_of(flight, sensor) for sensor in MEASURED]
    alone, beside = replayed(flight), replayed(flight, *gaps)
    assert len(beside.gaps) == len(gaps)
    for name in ("innovations", "states", "local_position", "flags"):
        left, right = getattr(alone, name), getattr(beside, name)
        for field in left.dtype.names:
            np.testing.assert_array_equal(left[field], right[field])


@pytest.mark.parametrize("sensor", MEASURED)
def test_filter_does_not_see_what_is_withheld(flight, sensor):
    gap = gap_of(flight, sensor)
    (true,), (false,) = replayed(flight, gap).gaps, replayed(shifted(flight, sensor, gap), gap).gaps
    _, _, source, axis, shift = MEASURED[sensor]
    for field in ("x", "y", "z", "vx", "vy", "vz", "heading", "q"):
        np.testing.assert_array_equal(true.local_position[field], false.local_position[field])
    one, other = innovations(true.innovations, source, axis), innovations(false.innovations, source, axis)
    np.testing.assert_array_equal(one["innovation_variance"], other["innovation_variance"])
    # Innovation is prediction less measurement, and only the measurement differs.
    difference = one["innovation"][-5:] - other["innovation"][-5:]
    np.testing.assert_allclose(np.abs(difference), shift, rtol=1e-3)
    assert not one["fused"].any()


@pytest.mark.parametrize("sensor", MEASURED)
def test_uncertainty_grows_while_a_sensor_is_withheld(flight, sensor):
    (result,) = replayed(flight, gap_of(flight, sensor)).gaps
    _, _, source, axis, _ = MEASURED[sensor]
    variance = innovations(result.innovations, source, axis)["innovation_variance"]
    assert variance[-1] > variance[0]


def test_nothing_is_reset_in_a_long_gap(flight):
    """Twenty seconds are beyond every time-out of the filter."""
    (result,) = replayed(flight, gap_of(flight, "gnss", START, START + 20_000_000)).gaps
    first, last = result.local_position
    for counter in ("xy_reset_counter", "z_reset_counter", "vxy_reset_counter", "vz_reset_counter"):
        assert first[counter] == last[counter]


def test_overlapping_gaps_are_independent(flight):
    early, late = gap_of(flight, "gnss"), gap_of(flight, "gnss", START + 3_000_000, STOP + 3_000_000)
    together = replayed(flight, early, late).gaps
    for one, gap in zip(together, (early, late), strict=True):
        (alone,) = replayed(flight, gap).gaps
        assert one.gap == gap
        np.testing.assert_array_equal(one.innovations["innovation"], alone.innovations["innovation"])


def test_gap_outside_the_flight_is_left_out(flight):
    assert replayed(flight, gap_of(flight, "gnss", 10_000_000_000, 10_009_000_000)).gaps == ()
