"""Sets tried on one flight: replays that record what scores read, gaps, and the scores themselves."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

from benchmarks.speed.quantities import Kind, Quantity
from benchmarks.speed.sample_flights import noise_sets, referenced_logs
from benchmarks.speed.sections.estimator import cpu_of
from benchmarks.speed.workplace import Workplace

SETS = 12
ANALYSES = 3
QUANTITIES = {
    "to_cpp": Quantity(f"scoring replay, {SETS} sets, CPU per update over PX4's C++", "", Kind.RATIO, 0.22),
    "flight_rate": Quantity("scoring replay, flight seconds", "1/CPU s", reach=6000.0, more_is_better=True),
    "gaps": Quantity("seconds in gaps over seconds of flight, in CPU time", "", Kind.RATIO),
    "scores": Quantity("one set more in the analysis of a flight, beyond its replay with gaps", "CPU s", reach=0.04),
    "pairs": Quantity("pairs of flight and set, replayed with gaps and scored", "1/CPU s", more_is_better=True),
    "tried": Quantity("… in memory, by `evaluate`", "1/CPU s", more_is_better=True),
}


def measure(work: Workplace) -> Iterator[tuple[str, float]]:
    """CPU times on one flight of a minute and a half, as logged."""
    from fusetune.analyze.analyze_flight import analyze_flight
    from fusetune.analyze.evaluate import evaluate
    from fusetune.analyze.replaying.prepared_flight import prepare_flight
    from fusetune.ekf2.compiled.compilation import ensure_compiled
    from fusetune.ekf2.replay import recording
    from fusetune.px4.ulog.reader import read_ulog
    from fusetune.save import save_log
    from fusetune.set_names import AS_FLOWN, PRESENT

    ensure_compiled()
    only_scored = {"recording": recording.SCORING} if hasattr(recording, "SCORING") else {}
    one = referenced_logs()[-1]
    prepared = prepare_flight(read_ulog(one.log))
    without_gaps = dataclasses.replace(prepared, gaps=())
    sets = noise_sets(SETS)
    updates = 0

    def replay_all(flight) -> None:  # type: ignore[no-untyped-def]
        nonlocal updates
        updates = 0
        for values in sets.values():
            done = flight.replay_into(_nothing, flight.parameters(values), frozenset(values), **only_scored)
            updates += done.updates

    replay_all(without_gaps)
    plain = cpu_of(lambda: replay_all(without_gaps))
    yield "to_cpp", plain / updates / one.cpu_s_per_update
    imu = prepared.inputs.arrays.imu["time_us"]
    flown_s = float(imu[-1] - imu[0]) * 1e-6
    yield "flight_rate", SETS * flown_s / plain
    gapped = cpu_of(lambda: replay_all(prepared))
    in_gaps_s = sum(gap.stop - gap.start for gap in prepared.gaps) * 1e-6
    yield "gaps", (gapped - plain) / plain / (in_gaps_s / flown_s)
    saved = work.folder() / "flight"
    save_log(one.log, saved)

    def analyze_with(more) -> None:  # type: ignore[no-untyped-def]
        always = {PRESENT: {}, AS_FLOWN: {}}
        analyze_flight(saved, work.folder(), always | more, [PRESENT, *more])

    fewest = dict(list(sets.items())[:1])
    more = cpu_of(lambda: analyze_with(sets), ANALYSES) - cpu_of(lambda: analyze_with(fewest), ANALYSES)
    yield "scores", more / (SETS - 1) - gapped / SETS
    yield "pairs", (SETS - 1) / more
    whole = cpu_of(lambda: evaluate(prepared, {PRESENT: {}, **sets}), ANALYSES)
    yield "tried", SETS / (whole - cpu_of(lambda: evaluate(prepared, {PRESENT: {}}), ANALYSES))


def _nothing(rows: object) -> None:
    """Takes rows and keeps none."""
