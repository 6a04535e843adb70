"""Parameters of the estimator that a vehicle flew with, also those that its log lacks."""

from __future__ import annotations

from fusetune.px4.flight import Flight
from fusetune.px4.flown_release import flown_release
from fusetune.px4.parameters.complete_sets import complete
from fusetune.px4.releases import BASELINE, FIRST


def flown_parameters(flight: Flight) -> dict[str, float]:
    """All parameters that the log begins with; those that it lacks at the defaults of the release that flew.

    In the names of the baseline, with those that this release alone has. Where the log does not tell the release, the
    defaults are the baseline's.
    """
    replayed = max(flown_release(flight).release or BASELINE, FIRST)
    return complete(flight.parameters.initial, {}, flight.release, replayed=replayed)
