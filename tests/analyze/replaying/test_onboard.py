"""Innovations that the vehicle logged."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.replaying.onboard import onboard_samples, with_onboard_columns
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.release_layouts import canonical


def test_a_flight_keeps_what_is_read_of_the_named_sources(survey_flight: Flight) -> None:
    flight = canonical(survey_flight)
    whole = onboard_samples(flight)
    assert {"gnss_vel", "gravity"} <= {source for source, _ in whole}
    small = with_onboard_columns(flight, ("gnss_vel",))
    kept = onboard_samples(small)
    assert sorted(kept) == [("gnss_vel", axis) for axis in range(3)]
    for key, samples in kept.items():
        for name, values in vars(samples).items():
            np.testing.assert_array_equal(values, getattr(whole[key], name))
    # the grade tells which estimator instances there were, also where nothing of them is compared
    assert {*small.topics["estimator_aid_src_gravity", 0]} == {"timestamp", "timestamp_sample"}
    assert ("estimator_innovations", 0) not in small.topics
    assert small.topics["sensor_combined", 0] is flight.topics["sensor_combined", 0]
