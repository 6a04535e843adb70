"""The estimator aboard the simulated vehicle: EKF2 itself, run on the flight's own sensors with the flown set."""

from __future__ import annotations

from fusetune.px4.flight import Flight, TopicKey, TopicTable


def estimator_topics(flight: Flight) -> dict[TopicKey, TopicTable]:
    """Topics that the vehicle's estimator publishes."""
    return {}
