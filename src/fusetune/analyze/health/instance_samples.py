"""What one estimator instance told of its aid sources: innovations or, where those were thinned apart, test ratios."""

from __future__ import annotations

from fusetune.analyze.replaying.onboard import OnboardSamples, onboard_samples
from fusetune.px4.flight import Flight, row_count
from fusetune.px4.layouts.onboard_innovations import tables_of_test_ratios

_LEAST_SHARE = 0.5
"""Of the rows with test ratios, as many have to be found again among the innovations."""


def instance_samples(flight: Flight, instance: int) -> OnboardSamples:
    """Samples of one instance, from its test ratios where its innovations have lost most of their variances.

    Parameters
    ----------
    flight : in the layout of v1.16
    """
    samples = onboard_samples(flight, instance)
    ratios = flight.topic("estimator_innovation_test_ratios", instance)
    most = max((samples[key].timestamp_sample.size for key in samples), default=0)
    if ratios is None or most >= _LEAST_SHARE * row_count(ratios):
        return samples
    told = onboard_samples(flight.with_topics(tables_of_test_ratios(flight, instance)), instance)
    return told if max((told[key].timestamp_sample.size for key in told), default=0) > most else samples
