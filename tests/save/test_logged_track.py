from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fusetune.errors import UserError
from fusetune.px4.flight import Flight
from fusetune.save.logged_track import logged_track, track_of_flight


def test_the_track_of_a_log_is_where_the_vehicle_truly_was(survey_flight: Flight) -> None:
    """Against the simulated vehicle's ground truth, as well as its estimator knew it."""
    track = track_of_flight(survey_flight, "survey.ulg")
    truth = survey_flight.topics["vehicle_local_position_groundtruth", 0]
    flown = track.in_air
    time_us = track.timestamp_us[flown]
    for axis, name in enumerate(("vx", "vy", "vz")):
        true = np.interp(time_us, truth["timestamp"], truth[name])
        assert np.sqrt(np.mean((track.velocity[flown, axis] - true) ** 2)) < 0.3
    assert np.ptp(track.position[flown, 2]) == pytest.approx(16.0, abs=2.5)
    assert track.origin.lat_deg == pytest.approx(47.397742, abs=1e-4)
    assert np.linalg.norm(track.attitude, axis=1) == pytest.approx(1.0)
    assert (np.diff(track.timestamp_us) > 0).all()
    # the biases that the estimator knew are taken off
    standing = track.at_rest
    assert np.abs(track.angular_rate[standing].mean(axis=0)).max() < 2e-3


def test_a_log_that_never_knew_its_place_is_told(survey_flight: Flight, tmp_path: Path) -> None:
    place = survey_flight.topics["vehicle_local_position", 0]
    nowhere = place | {"ref_lat": np.full(len(place["timestamp"]), np.nan)}
    lost = survey_flight.with_topics({**survey_flight.topics, ("vehicle_local_position", 0): nowhere})
    with pytest.raises(UserError, match="never knew its place"):
        track_of_flight(lost, "lost.ulg")
    broken = tmp_path / "broken.ulg"
    broken.write_bytes(b"no log")
    with pytest.raises(UserError):
        logged_track(broken)
