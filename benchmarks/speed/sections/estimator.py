"""The estimator alone: a flight replayed with full recording, and where its time goes.

The time of a flight is that of its filter updates and that of its IMU samples; replays of one flight with other
intervals between updates (EKF2_PREDICT_US) tell them apart.
"""

from __future__ import annotations

import importlib.util
import statistics
import time
from collections.abc import Callable, Iterator
from types import ModuleType

import numpy as np
from benchmarks.speed.quantities import Kind, Lacking, Quantity
from benchmarks.speed.sample_flights import referenced_logs
from benchmarks.speed.workplace import Workplace

INTERVALS_US = (5000, 8000, 10000, 20000)
REPEATS = 7
QUANTITIES = {
    "to_cpp": Quantity("full replay, CPU per update over that of PX4's C++", "", Kind.RATIO, 0.35),
    "per_update": Quantity("full replay, all per update", "µs"),
    "of_update": Quantity("… of which a filter update", "µs"),
    "of_sample": Quantity("… and each IMU sample beside it", "µs"),
    "prediction": Quantity("one prediction of state and covariance", "µs"),
    "fusion": Quantity("one scalar measurement update", "µs"),
}


def measure(work: Workplace) -> Iterator[tuple[str, float]]:
    """CPU times of replays, µs."""
    from fusetune.ekf2.compiled.compilation import ensure_compiled
    from fusetune.ekf2.feed.inputs import build_inputs
    from fusetune.ekf2.replay.replay import replay
    from fusetune.px4.layouts.release_layouts import canonical
    from fusetune.px4.parameters.complete_sets import complete
    from fusetune.px4.ulog.reader import read_ulog

    ensure_compiled()
    ratios, costs, rows = [], [], []
    logs = referenced_logs()
    for one in logs[:1] if work.quick else logs:
        flight = read_ulog(one.log)
        inputs = build_inputs(canonical(flight))
        for interval in (None, *INTERVALS_US):
            values = {} if interval is None else {"EKF2_PREDICT_US": interval}
            params = complete(flight.parameters.initial, values, flight.release)
            overridden = frozenset(values)
            done = replay(inputs, params, overridden=overridden)
            cpu_s = cpu_of(lambda inputs=inputs, params=params, o=overridden: replay(inputs, params, overridden=o))
            if interval is None:
                costs.append(cpu_s / done.updates)
                ratios.append(costs[-1] / one.cpu_s_per_update)
            else:
                rows.append((done.updates, done.imu_samples, cpu_s))
    yield "to_cpp", statistics.median(ratios)
    yield "per_update", statistics.median(costs) * 1e6
    counted = np.array(rows)
    (of_update, of_sample), *_ = np.linalg.lstsq(counted[:, :2] / counted[:, 2:], np.ones(len(rows)), rcond=None)
    yield "of_update", of_update * 1e6
    yield "of_sample", of_sample * 1e6
    parts = _parts(work)
    yield "prediction", parts.prediction_cost() * 1e6
    yield "fusion", parts.fusion_cost() * 1e6


def cpu_of(work: Callable[[], object], repeats: int = REPEATS) -> float:
    """CPU seconds of a piece of work that is warm, the fastest of some."""
    samples = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        samples.append(time.process_time() - begin)
    return min(samples)


def _parts(work: Workplace) -> ModuleType:
    """The tree's own way to time the parts of its filter."""
    file = work.tree / "benchmarks" / "estimator_speed.py"
    spec = importlib.util.spec_from_file_location("estimator_speed_of_tree", file)
    if spec is None or spec.loader is None or not file.is_file():
        raise Lacking(f"there is no {file.name}")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
