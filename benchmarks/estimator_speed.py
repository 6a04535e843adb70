"""How fast the estimator is, as ratios within one run.

    python benchmarks/estimator_speed.py LOG.ulg [REFERENCE_JSON]

Prints CPU time per filter update and per IMU sample of a full and of a scoring recording, the latter of eight sets on
one flight; the schedule of a flight, which sets share; flight seconds per CPU second; gaps by the second; the shares of
prediction, fusion and everything else, start-up of one replay process, and peak memory. With the JSON file of a
reference replay of the same log, also the ratios to the CPU time per update of PX4's own estimator (another run of the
same kind of machine).
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numba import njit

from fusetune.ekf2.compiled.compilation import ensure_compiled
from fusetune.ekf2.feed.inputs import EstimatorInputs, build_inputs
from fusetune.ekf2.filter.common.core_memory import CORE_MEMORY
from fusetune.ekf2.filter.common.parameters import complete, parameter_record
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import compute_kalman_gain
from fusetune.ekf2.filter.prediction import predict_covariance, predict_state
from fusetune.ekf2.replay.flight_schedule import flight_schedule
from fusetune.ekf2.replay.recording import SCORING
from fusetune.ekf2.replay.replay import replay, replay_into
from fusetune.ekf2.replay.results import Gap
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.ulog.reader import read_ulog

REPEATS = 9
LOOPS = 20_000
SETS = 8
GAP_US = 5_000_000


@njit
def many_joseph_updates(ekf, params, H, loops):  # type: ignore[no-untyped-def]
    """A three-axis observation of attitude and field moves the most states."""
    for _ in range(loops):
        compute_kalman_gain(ekf, H, 1e9)
        measurement_update(ekf, params, 1.0, 0.0)


@njit
def many_predictions(ekf, params, loops):  # type: ignore[no-untyped-def]
    """Covariance and state over one interval at rest."""
    for _ in range(loops):
        predict_covariance(ekf, params)
        predict_state(ekf, params)


def cpu_seconds(work: Callable[[], object]) -> float:
    """Median CPU seconds of a piece of work."""
    work()
    samples = []
    for _ in range(REPEATS):
        start = time.process_time()
        work()
        samples.append(time.process_time() - start)
    return statistics.median(samples)


def fusion_cost() -> float:
    """CPU seconds of one scalar measurement update."""
    ekf, params = np.zeros(1, CORE_MEMORY), parameter_record(complete({}, {}, None))
    ekf["P"][0] = np.eye(24)
    ekf["q"][0, 0] = 1.0
    H = np.zeros(24)
    H[:9] = 1.0
    return cpu_seconds(lambda: many_joseph_updates(ekf[0], params[0], H, LOOPS)) / LOOPS


def prediction_cost() -> float:
    """CPU seconds of one prediction of covariance and state."""
    ekf, params = np.zeros(1, CORE_MEMORY), parameter_record(complete({}, {}, None))
    ekf["P"][0] = np.eye(24) * 1e-3
    ekf["q"][0, 0] = 1.0
    ekf["R_to_earth"][0] = np.eye(3)
    ekf["dt_ekf_avg"] = 0.01
    ekf["imu_delayed"]["delta_ang_dt"] = ekf["imu_delayed"]["delta_vel_dt"] = 0.01
    ekf["imu_delayed"]["delta_vel"][0, 2] = -0.0980665
    return cpu_seconds(lambda: many_predictions(ekf[0], params[0], LOOPS)) / LOOPS


def scoring_cost(inputs: EstimatorInputs, sets: Sequence[Mapping[str, float]]) -> float:
    """CPU seconds of a scoring replay of one set, of some on a flight that was never replayed before."""

    def replay_all() -> None:
        fresh = replace(inputs)
        for params in sets:
            replay_into(lambda rows: None, fresh, params, recording=SCORING)

    return cpu_seconds(replay_all) / len(sets)


def schedule_cost(inputs: EstimatorInputs, params: Mapping[str, float]) -> float:
    """CPU seconds of the schedule of a flight."""
    record = parameter_record(params)[0]
    return cpu_seconds(lambda: flight_schedule(replace(inputs), record, ()))


def gap_cost(inputs: EstimatorInputs, params: Mapping[str, float]) -> float:
    """CPU seconds of a second in a gap."""
    first, last = inputs.arrays.imu["time_us"][[0, -1]].tolist()
    gaps = [Gap("baro", start, start + GAP_US) for start in range(first, last - GAP_US, GAP_US)]
    if not gaps:
        return float("nan")

    def with_gaps(some: Sequence[Gap]) -> float:
        return cpu_seconds(lambda: replay_into(lambda rows: None, inputs, params, gaps=some, recording=SCORING))

    return (with_gaps(gaps) - with_gaps(())) / (len(gaps) * GAP_US * 1e-6)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path)
    parser.add_argument("reference", type=Path, nargs="?")
    options = parser.parse_args()
    ensure_compiled()
    flight = read_ulog(options.log)
    inputs = build_inputs(canonical(flight))
    params = complete(flight.parameters.initial, {}, flight.release)
    result = replay(inputs, params)
    total = cpu_seconds(lambda: replay(inputs, params))
    span_s = float(inputs.arrays.imu["time_us"][-1] - inputs.arrays.imu["time_us"][0]) * 1e-6
    # the gravity aid reports itself fused at every update, also where it was not
    fused = int((result.innovations["fused"] & (result.source_names() != "gravity")).sum())
    fusion = fused * fusion_cost()
    prediction = result.updates * prediction_cost()
    per_update = total / result.updates
    overrides = [{"EKF2_BARO_NOISE": 2.0 + 0.5 * number} for number in range(SETS)]
    sets = [complete(flight.parameters.initial, one, flight.release) for one in overrides]
    scoring = scoring_cost(inputs, sets)
    print(f"{options.log.stem}: {result.updates} updates, {result.imu_samples} IMU samples, {span_s:.1f} s of flight")
    print(f"  per update            {per_update * 1e6:8.2f} µs")
    print(f"  per IMU sample        {total / result.imu_samples * 1e6:8.2f} µs")
    print(f"  flight s per CPU s    {span_s / total:8.0f}")
    print(f"  scoring, of {SETS} sets    {scoring / result.updates * 1e6:8.2f} µs per update")
    print(f"  ... flight s per CPU s{span_s / scoring:8.0f}")
    print(f"  schedule, once        {schedule_cost(inputs, params) / result.updates * 1e6:8.2f} µs per update")
    print(f"  a second in a gap     {gap_cost(inputs, params) * span_s / scoring:8.2f} of a second on the way")
    rest = 1.0 - (prediction + fusion) / total
    print(f"  prediction            {prediction / total:8.0%}")
    print(
        f"  fusion                {fusion / total:8.0%} ({fused / result.updates:.2f} scalar updates per filter update)"
    )
    print(f"  control and the rest  {rest:8.0%}")
    if options.reference:
        reference = json.loads(options.reference.read_text(encoding="utf-8"))
        ratio = per_update / (reference["cpu_s"] / reference["n_updates"])
        print(f"  ratio to PX4's C++    {ratio:8.2f}, scoring {ratio * scoring / total:.2f}")
    print(f"  one process, warm     {process_seconds(options.log):8.2f} s wall (start, imports, kernels, log, replay)")
    print(f"  peak memory           {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:8.0f} MB")


def process_seconds(log: Path) -> float:
    """Wall seconds of a whole process that reads one log and replays it."""
    code = (
        "import sys; from pathlib import Path; from fusetune.px4.ulog.reader import read_ulog;"
        "from fusetune.px4.layouts.release_layouts import canonical;"
        "from fusetune.ekf2.feed.inputs import build_inputs;"
        "from fusetune.ekf2.filter.common.parameters import complete; from fusetune.ekf2.replay.replay import replay;"
        "f = read_ulog(Path(sys.argv[1])); i = build_inputs(canonical(f));"
        "replay(i, complete(f.parameters.initial, {}, f.release))"
    )
    samples = []
    for _ in range(3):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code, str(log)], check=True)
        samples.append(time.perf_counter() - start)
    return min(samples)


if __name__ == "__main__":
    sys.exit(main())
