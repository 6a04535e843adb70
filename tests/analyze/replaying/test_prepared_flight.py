"""What the replays of a flight share."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.analyze_flight import COMPARED_TOPICS, REFERENCE_TOPICS
from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS, prepare_flight
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.release_layouts import canonical


def with_topics(flight: Flight, topics: tuple[str, ...]) -> Flight:
    return flight.with_topics({key: table for key, table in flight.topics.items() if key[0] in topics})


def test_a_flight_read_in_parts_is_the_one_read_at_once(survey_flight: Flight) -> None:
    """`estimator_status` alone would make other `estimator_status_flags` than the log holds."""
    status = {
        "timestamp": survey_flight.topics["estimator_status_flags", 0]["timestamp"][::2],
        "control_mode_flags": np.zeros(
            len(survey_flight.topics["estimator_status_flags", 0]["timestamp"][::2]), np.uint64
        ),
    }
    flight = survey_flight.with_topics(survey_flight.topics | {("estimator_status", 0): status})
    logged = canonical(with_topics(flight, COMPARED_TOPICS))
    assert ("estimator_status_flags", 0) in logged.topics
    references = canonical(with_topics(flight, REFERENCE_TOPICS))
    assert ("vehicle_attitude_groundtruth", 0) in references.topics
    replayed = prepare_flight(with_topics(flight, REPLAY_TOPICS)).flight
    found = replayed.with_more(logged).with_more(references).topics
    whole = canonical(with_topics(flight, (*REPLAY_TOPICS, *COMPARED_TOPICS, *REFERENCE_TOPICS))).topics
    assert found.keys() == whole.keys()
    for key, table in whole.items():
        assert found[key].keys() == table.keys()
        for column, values in table.items():
            np.testing.assert_array_equal(found[key][column], values, err_msg=f"{key} {column}")
