"""Whether a log holds the samples that the vehicle's own estimator was given.

`ekf2_timestamps`, which the logging profile for estimator replay adds, names with every update of the estimator the
messages that it took: their time relative to its own, in units of 0.1 ms.
"""

from __future__ import annotations

import numpy as np

from fusetune.px4.aid_sources import SENSOR_TOPICS
from fusetune.px4.flight import Flight

RELATIVE_TICK_US = 100
RELATIVE_TIMESTAMP_INVALID = 0x7FFF
RELATIVE_FIELDS = {topic.name: topic.relative_field for topic in SENSOR_TOPICS.values() if topic.relative_field}
"""Fields of `ekf2_timestamps` by the topics whose messages they name."""

_ROUNDING_US = 150
_COMPLETE_SHARE = 0.98
"""A logger drops a message now and then."""


def logged_share(flight: Flight, topic: str) -> float | None:
    """Share of the samples of a sensor that the estimator took and the log holds; None where it names none.

    Parameters
    ----------
    topic
        `vehicle_magnetometer`, `vehicle_air_data` or another that `ekf2_timestamps` has a field for.
    """
    named = taken_times(flight, topic)
    if named is None:
        return None
    shares = [_share_in(named, flight.topics[topic, instance]["timestamp"]) for instance in flight.instances(topic)]
    return max(shares, default=0.0)


def taken_times(flight: Flight, topic: str) -> np.ndarray | None:
    """Times of the samples of a sensor that the estimator took, µs to 0.1 ms, logged or not; None where none is named.

    Parameters
    ----------
    topic
        As for `logged_share`.
    """
    updates = flight.topic("ekf2_timestamps")
    relative = None if updates is None else updates.get(RELATIVE_FIELDS.get(topic, ""))
    if updates is None or relative is None:
        return None
    taken = relative != RELATIVE_TIMESTAMP_INVALID
    if not taken.any():
        return None
    named = np.sort(updates["timestamp"][taken] + relative[taken].astype(np.int64) * RELATIVE_TICK_US)
    # one sample named by two updates may be rounded to two neighbouring units
    return named[np.append(True, np.diff(named) > _ROUNDING_US)]


def _share_in(named: np.ndarray, logged: np.ndarray) -> float:
    """Share of times that are among other times, to the rounding of their unit."""
    if not len(logged):
        return 0.0
    logged = np.sort(logged)
    after = np.minimum(np.searchsorted(logged, named), len(logged) - 1)
    before = np.maximum(after - 1, 0)
    apart = np.minimum(np.abs(logged[after] - named), np.abs(logged[before] - named))
    return float(np.mean(apart <= _ROUNDING_US))


def is_complete(share: float | None) -> bool:
    """Whether a log with such a share of the samples holds them all, but for single ones."""
    return share is not None and share >= _COMPLETE_SHARE
