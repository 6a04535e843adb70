"""The smoothed velocity of flights: its cost, how near it is to the truth, and whether it favours what it is made of.

    python -m benchmarks.smoothed_reference SAVED_FLIGHT [SAVED_FLIGHT …]

Each is a folder of `results/save`. CPU times are of one process, per minute of the scored flight and in replays of one
set. Where the flight has a ground truth, RMS errors of velocity stand beside them. Then the reference is made of the
replay of other sets: how far it is from the present set's (RMS), and by how much that changes the score of each of
these sets against the median of all.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.flight.reference_truth import read_truth
from fusetune.analyze.metrics.attitude import interpolate
from fusetune.analyze.replaying.prepared_flight import prepare_flight
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.scoring.score_sets import scored_flight
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.smoothed_scores import STEP_US
from fusetune.analyze.scoring.window import scoring_window
from fusetune.analyze.smoothing.smoothed_velocity import SmoothedVelocity, smoothed_velocity
from fusetune.px4.flight import Flight
from fusetune.save.flight_folder import load_flight
from fusetune.set_names import PRESENT

SETS = {
    PRESENT: {},
    "process x5": {"EKF2_ACC_NOISE": 1.0, "EKF2_GYR_NOISE": 0.075},
    "process d5": {"EKF2_ACC_NOISE": 0.07, "EKF2_GYR_NOISE": 0.003},
    "gnss x4": {"EKF2_GPS_V_NOISE": 1.2, "EKF2_GPS_P_NOISE": 2.0},
}


def measure(folder: Path) -> None:
    """Print the figures of one flight."""
    prepared = prepare_flight(load_flight(folder))
    replay_set(prepared, PRESENT, {})  # loads the kernels
    start = time.process_time()
    records = {name: replay_set(prepared, name, overrides) for name, overrides in SETS.items()}
    replay_s = (time.process_time() - start) / len(SETS)
    scored = scored_flight(prepared.flight)
    present = records[PRESENT]
    airborne = airborne_intervals(scored.flight, present.flags)
    window = scoring_window(present, airborne, scored.log_gaps, ScoringSettings())
    start = time.process_time()
    references = {
        name: smoothed_velocity(record, scored.flight, window.intervals, STEP_US) for name, record in records.items()
    }
    smoothing_s = (time.process_time() - start) / len(SETS)
    print(
        f"{folder}: {60.0 * smoothing_s / window.duration_s:.3f} s per minute, {smoothing_s / replay_s:.2f} replays "
        f"of {replay_s:.2f} s"
    )
    own = references[PRESENT]
    if own is not None:
        _against_truth(scored.flight, own, records)
        _of_other_replays(own, references, records)


def _against_truth(flight: Flight, reference: SmoothedVelocity, records: dict[str, ReplayedSet]) -> None:
    truth = read_truth(flight)
    if truth is None or not truth.velocity.size:
        return
    true = interpolate(truth.time, truth.velocity, reference.time)
    print(f"  reference {_rms(reference.velocity - true)} m/s from the truth")
    for name, record in records.items():
        print(f"  {name} {_rms(_velocity(record, reference) - true)}")


def _of_other_replays(
    own: SmoothedVelocity, references: dict[str, SmoothedVelocity | None], records: dict[str, ReplayedSet]
) -> None:
    first = _scores(own, records)
    for place, (name, other) in enumerate(references.items()):
        if other is not None and other is not own:
            apart = interpolate(other.time, other.velocity, own.time) - own.velocity
            change = _scores(other, records) - first
            change -= np.median(change)
            print(f"  made of {name}: {_rms(apart)} m/s apart, its own score {100.0 * change[place]:+.2f} %")


def _velocity(record: ReplayedSet, reference: SmoothedVelocity) -> np.ndarray:
    states = record.states()
    return interpolate(states.time, states.velocity, reference.time)


def _scores(reference: SmoothedVelocity, records: dict[str, ReplayedSet]) -> np.ndarray:
    differences = [_velocity(record, reference) - reference.velocity for record in records.values()]
    return np.array([np.mean(0.5 * np.log(np.mean(np.square(one), axis=0))) for one in differences])


def _rms(values: np.ndarray) -> str:
    return " ".join(f"{one:.4f}" for one in np.sqrt(np.mean(np.square(values), axis=0)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("flights", nargs="+", type=Path)
    for one in parser.parse_args().flights:
        measure(one)
