"""The course of a reference that a flight is compared with, and the ground truth of a simulated flight."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.px4.flight import Flight, TopicTable, stacked

Array = npt.NDArray[np.float64]

_LONGEST_GAP = 3.0
"""In sample spacings: between samples further apart the truth is not known."""
_SHORTEST_GAP_US = 100_000


@dataclass(frozen=True)
class Truth:
    """A reference; time µs, NED m and m/s, quaternion (w, x, y, z) body → NED; arrays of size 0 where not known.

    Attributes
    ----------
    reference : latitude and longitude, deg, and altitude, m, of the origin of `position`, or None where it is unknown
    kind : prefix of the figures' source: `truth`, `rtk`, `rtk_fed`, `mocap` or `vision`
    own_north : the reference's north is its own, so a constant heading between it and the estimate is taken out
    lever_arm : (3,) from the body's origin to where position and velocity hold, m, FRD
    """

    time: npt.NDArray[np.int64]
    position: Array
    velocity: Array
    attitude_time: npt.NDArray[np.int64]
    quaternion: Array
    reference: tuple[float, float, float] | None
    kind: str = "truth"
    own_north: bool = False
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def known_at(self, time: npt.NDArray[np.int64], *, attitude: bool = False) -> npt.NDArray[np.bool_]:
        """True for the times (N,), µs, that lie between two samples of the reference close together."""
        own = self.attitude_time if attitude else self.time
        if own.size < 2:
            return np.zeros(time.shape, dtype=bool)
        gap = np.diff(own)
        after = np.searchsorted(own, time)
        inside = (time >= own[0]) & (time <= own[-1])
        longest = max(_LONGEST_GAP * float(np.median(gap)), _SHORTEST_GAP_US)
        return inside & (gap[np.clip(after - 1, 0, gap.size - 1)] <= longest)


def read_truth(flight: Flight) -> Truth | None:
    """Ground truth of a simulated flight, or None where the log has none.

    Frames and times are those of the estimator's own topics: NED, body FRD, µs of the same clock. Gazebo logs of PX4
    v1.17 show how errors against it can surprise: their true attitude differs from the estimated one by 6° in heading
    at rest and up to 14° in flight, while tilt agrees within 0.2° and velocity within centimetres per second, whatever
    the shift in time. That is a true heading error: the simulated magnetic field points 2.6° west of true north where
    the estimator's field model says 3.4° east, and its samples are those of a sensor that sits a quarter turn off
    (`fusetune.save.checks.magnetometer_mounting`). Hence heading and tilt have figures of their own.
    """
    local = flight.topic("vehicle_local_position_groundtruth")
    attitude = flight.topic("vehicle_attitude_groundtruth")
    if local is None or local["timestamp"].size < 2:
        return None
    reference = None
    if all(name in local for name in ("ref_lat", "ref_lon", "ref_alt")) and np.any(local["ref_lat"] != 0.0):
        reference = (float(local["ref_lat"][-1]), float(local["ref_lon"][-1]), float(local["ref_alt"][-1]))
    has_attitude = attitude is not None and attitude["timestamp"].size > 1
    return Truth(
        time=sample_times(local),
        position=np.column_stack([local[name] for name in ("x", "y", "z")]).astype(np.float64),
        velocity=np.column_stack([local[name] for name in ("vx", "vy", "vz")]).astype(np.float64),
        attitude_time=sample_times(attitude) if attitude is not None and has_attitude else np.zeros(0, dtype=np.int64),
        quaternion=stacked(attitude, "q") if attitude is not None and has_attitude else np.zeros((0, 4)),
        reference=reference,
    )


def sample_times(table: TopicTable) -> npt.NDArray[np.int64]:
    """Times, µs, at which the samples of a topic were taken; those of publication where the log has no others."""
    sample = table.get("timestamp_sample")
    time = table["timestamp"] if sample is None or not np.all(sample > 0) else sample
    return time.astype(np.int64)
