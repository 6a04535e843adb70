"""What a flight of the study leaves behind for research: estimates of all sets, the receiver's word, and the truth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fusetune.analyze.flight.ground_truth import read_truth
from fusetune.analyze.replaying.store.reader import read_states
from fusetune.save.flight_folder import load_flight

EVERY_US = 50_000
TOPICS = ("vehicle_gps_position", "vehicle_local_position_groundtruth", "vehicle_attitude_groundtruth")


def write_raw(path: Path, flight_folder: Path, analyzed: Path, sets: Sequence[str]) -> None:
    """Write one flight as NPZ.

    Parameters
    ----------
    path : the file. It holds `sets` (S,); per set `<set>.time_us` (on the fusion horizon), `<set>.velocity` (NED, m/s)
        and `<set>.quaternion` (w, x, y, z; body → NED), about 20 Hz; `gnss.time_us` (of receipt), `gnss.velocity` (NED,
        m/s), `gnss.position` (latitude °, longitude °, altitude m), `gnss.speed_accuracy`; `truth.time_us`,
        `truth.position` (NED, m), `truth.velocity`, `truth.attitude_time_us`, `truth.quaternion`
    flight_folder : the saved flight
    analyzed : the replays of all sets
    """
    arrays: dict[str, np.ndarray] = {"sets": np.array(sets)}
    for name in sets:
        states = read_states(analyzed, name)
        rows = np.unique(np.searchsorted(states.time, np.arange(states.time[0], states.time[-1], EVERY_US)))
        arrays[f"{name}.time_us"] = states.time[rows]
        arrays[f"{name}.velocity"] = states.velocity[rows].astype(np.float32)
        arrays[f"{name}.quaternion"] = states.quaternion[rows].astype(np.float32)
    flight = load_flight(flight_folder, topics=TOPICS)
    gnss = flight.topics["vehicle_gps_position", 0]
    arrays["gnss.time_us"] = gnss["timestamp"]
    arrays["gnss.velocity"] = np.column_stack([gnss[f"vel_{axis}_m_s"] for axis in "ned"])
    arrays["gnss.position"] = np.column_stack(
        [gnss[name] for name in ("latitude_deg", "longitude_deg", "altitude_msl_m")]
    )
    arrays["gnss.speed_accuracy"] = gnss["s_variance_m_s"]
    truth = read_truth(flight)
    assert truth is not None, flight_folder
    arrays |= {"truth.time_us": truth.time, "truth.position": truth.position, "truth.velocity": truth.velocity}
    arrays |= {"truth.attitude_time_us": truth.attitude_time, "truth.quaternion": truth.quaternion}
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, **arrays)
