"""Cost of long flights: saved, reconstructed and replayed, in CPU seconds per minute of flight, as Markdown.

    python -m benchmarks.long_flights [--minutes 15 30 60]

Simulated flights, laps of the survey mission with the vehicle's own estimator on board, at full rate and thinned as the
default logging profile thins a log. Replayed with all gaps of the default configuration. Where the cost is linear in
the length, the figures of a line agree.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.save_speed import peak_bytes, simulated
from benchmarks.thinned_logs import Thinning, thinned

from fusetune.analyze.flight_phases import airborne_intervals
from fusetune.analyze.reconstruction import ReconstructionSettings, reconstruct
from fusetune.analyze.replay_flight import prepare
from fusetune.analyze.withheld_gaps import WithholdingSettings, plan_gaps
from fusetune.ekf2.compilation import ensure_compiled
from fusetune.ekf2.parameters import complete
from fusetune.px4.flight import Flight
from fusetune.px4.release_layouts import canonical
from fusetune.save import save_log
from fusetune.save.flight_folder import load_flight


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, nargs="+", default=[15.0, 30.0, 60.0])
    options = parser.parse_args()
    ensure_compiled()
    print(
        "| flight | MB | saved, MB/s | CPU s a minute: saved | replayed | thinned: reconstructed | replayed | peak GB |"
    )
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        for minutes in (2.0, *options.minutes):
            log, _ = simulated(Path(scratch) / f"{minutes:g}.ulg", minutes, True)
            cells = _row(log, Path(scratch) / f"{minutes:g}")
            log.unlink()
            # the first flight is there to compile and to warm up
            if minutes > 2.0:
                print(f"| {' | '.join(cells)} |", flush=True)


def _row(log: Path, folder: Path) -> list[str]:
    size = log.stat().st_size / 1e6
    saved_s = _cpu_s(lambda: save_log(log, folder))
    flight = canonical(load_flight(folder))
    small = thinned(flight, Thinning())
    minutes = (flight.last_timestamp - flight.start_timestamp) / 6e7
    replayed_s = _cpu_s(lambda: _replay(flight))
    repaired: list[Flight] = []
    reconstructed_s = _cpu_s(lambda: repaired.append(reconstruct(small, ReconstructionSettings()).flight))
    thinned_s = _cpu_s(lambda: _replay(repaired[0]))
    times = (saved_s, replayed_s, reconstructed_s, thinned_s)
    return [
        f"{minutes:.1f} min",
        f"{size:.0f}",
        f"{size / saved_s:.0f}",
        *(f"{seconds / minutes:.3f}" for seconds in times),
        f"{peak_bytes() / 1e9:.2f}",
    ]


def _replay(flight: Flight) -> None:
    gaps = plan_gaps(flight, airborne_intervals(flight, {}), WithholdingSettings())
    prepare(flight, None, None, gaps).replay(complete(flight.parameters.initial, {}, flight.release))


def _cpu_s(work: Callable[[], object]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


if __name__ == "__main__":
    main()
