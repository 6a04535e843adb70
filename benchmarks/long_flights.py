"""Cost of long flights: CPU seconds per minute of flight, and peak memory of the jobs that a flight takes, as Markdown.

    python -m benchmarks.long_flights [--minutes 10 20 60] [--jobs save diagnose]

Simulated flights, laps of the survey mission with the vehicle's own estimator on board, at full rate and thinned as the
default logging profile thins a log. Each is saved, replayed with one set, diagnosed, analysed with all sets of the
shipped study and drawn, each job in a process of its own and as the workflow runs it; of the analysis the largest step
is told, too. Where the cost is linear in the length, the figures of a column agree.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks.save_speed import ROOT, peak_bytes, simulated

import fusetune
from fusetune.design.study import load_study
from fusetune.running.job_environment import JOB_ENVIRONMENT
from fusetune.save.flight_folder import read_metadata

# All else is imported where it is needed: what a job does not load must not count as its memory.

STUDY = ROOT / "config/studies/paper_table11.yaml"
JOBS = ("save", "replay", "diagnose", "analyse", "draw")
ANALYSIS_STEPS = ("write_replay", "grade_flight", "write_flight_fidelity", "write_scores")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, nargs="+", default=[10.0, 20.0, 60.0])
    parser.add_argument("--jobs", nargs="+", choices=JOBS, default=JOBS, help="that are measured; all build on save")
    parser.add_argument("--job", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.job:
        print(json.dumps(_measured(options.job[0], Path(options.job[1]))))
        return
    from benchmarks.thinned_logs import Thinning, thinned

    from fusetune.px4.layouts.release_layouts import canonical
    from fusetune.px4.ulog.writer import write_ulog
    from fusetune.save.flight_folder import load_flight

    jobs = [job for job in JOBS if job in options.jobs or job == "save"]
    steps = ", ".join(step.replace("_", " ") for step in ANALYSIS_STEPS)
    peaks = [f"peak MB: {job} ({steps})" if job == "analyse" else f"peak MB: {job}" for job in jobs]
    head = ["flight", "MB", *(f"CPU s a minute: {job}" for job in jobs), *peaks]
    print(f"| {' | '.join(head)} |")
    print("|---" * len(head) + "|")
    for minutes in (2.0, *options.minutes):
        with tempfile.TemporaryDirectory() as scratch:
            log, _ = simulated(Path(scratch) / "full_rate.ulg", minutes, True)
            rows = [_row("full rate", log, jobs)]
            small = thinned(canonical(load_flight(log.with_suffix(".saved"))), Thinning())
            log.unlink()
            log = log.with_name("thinned.ulg")
            write_ulog(log, small)
            rows.append(_row("thinned", log, jobs))
        # the first flight is there to compile and to warm up
        if minutes > 2.0:
            print("\n".join(f"| {' | '.join(cells)} |" for cells in rows), flush=True)


def _row(kind: str, log: Path, jobs: Sequence[str]) -> list[str]:
    done = [in_own_process(job, log) for job in jobs]
    metadata = read_metadata(log.with_suffix(".saved"))
    minutes = (metadata["last_timestamp"] - metadata["start_timestamp"]) / 6e7
    peaks = []
    for one in done:
        steps = ", ".join(f"{one['steps'][step] / 1e6:.0f}" for step in ANALYSIS_STEPS if step in one["steps"])
        peaks.append(f"{one['peak'] / 1e6:.0f}" + (f" ({steps})" if steps else ""))
    return [
        f"{minutes:.1f} min, {kind}",
        f"{log.stat().st_size / 1e6:.0f}",
        *(f"{one['cpu_s'] / minutes:.2f}" for one in done),
        *peaks,
    ]


def in_own_process(job: str, log: Path) -> dict[str, Any]:
    """CPU time and peak memory of a job on a log, whose files lie beside it, and of its steps."""
    command = [sys.executable, "-m", "benchmarks.long_flights", "--job", job, str(log)]
    environment = os.environ | JOB_ENVIRONMENT
    return json.loads(subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout)


def _keep_out(package: str) -> None:
    """As jobs of the pipeline do; it stood elsewhere in earlier revisions, whose package may be the one at hand."""
    try:
        jobs = import_module("fusetune.running.job")
    except ModuleNotFoundError:
        sys.path.insert(0, str(Path(fusetune.__file__).resolve().parents[2] / "workflow" / "scripts"))
        jobs = import_module("job")
    jobs.keep_out(package)


def _measured(job: str, log: Path) -> dict[str, Any]:
    """CPU time and peak memory of one job; of the analysis also the peak of each step."""
    _keep_out("pandas")
    saved, analysis = log.with_suffix(".saved"), log.with_suffix(".analysis")
    steps: dict[str, int] = {}
    if job == "save":
        from fusetune.save import save_log

        work: Callable[[], object] = lambda: save_log(log, saved)  # noqa: E731
    elif job == "replay":
        from fusetune.analyze.replaying.replay_flight import replay_saved_flight
        from fusetune.analyze.replaying.settings import IN_USE

        work = lambda: replay_saved_flight(saved, {"present": {}}, log.with_suffix(".replay"), IN_USE)  # noqa: E731
    elif job == "diagnose":
        from fusetune.analyze.diagnose_flight import diagnose_flight

        work = lambda: diagnose_flight(saved, analysis)  # noqa: E731
    elif job == "analyse":
        work = _analysis(saved, analysis, steps)
    else:
        from fusetune.report.flight_data.write_blob import write_blob

        sets = [pset.name for pset in load_study(STUDY).sets]
        small, large = (log.with_suffix(suffix) for suffix in (".blob", ".large.blob"))
        work = lambda: write_blob(saved, analysis, small, large, sets)  # noqa: E731
    begin = time.process_time()
    peak = _peak_of(work)
    return {"cpu_s": time.process_time() - begin, "peak": max(peak, *steps.values(), 0), "steps": steps}


def _analysis(saved: Path, analysis: Path, steps: dict[str, int]) -> Callable[[], object]:
    """The analysis of all sets; its steps enter their peak memory."""
    from fusetune.analyze import analyze_flight as room
    from fusetune.save.present import FlightSets

    def noting(name: str, step: Callable[..., Any]) -> Callable[..., Any]:
        def noted(*arguments: Any, **options: Any) -> Any:
            results: list[Any] = []
            steps[name] = _peak_of(lambda: results.append(step(*arguments, **options)))
            return results.pop()

        return noted

    for name in [name for name in ANALYSIS_STEPS if hasattr(room, name)]:
        setattr(room, name, noting(name, getattr(room, name)))
    values = read_metadata(saved)["ekf2_parameters"]
    sets = FlightSets({pset.name: pset.overrides for pset in load_study(STUDY).sets})
    present = {name: values[name] for name in sets.varied if name in values}
    replayed = sets.overrides(sets.replayed, present)
    # as in the workflow, which keeps what was made of the same; without, all scores would stay in memory
    made_with = {"made_with": room.MadeWith("", "")} if hasattr(room, "MadeWith") else {}
    return lambda: room.analyze_flight(saved, analysis, replayed, sets.scored, **made_with)


def _peak_of(work: Callable[[], object]) -> int:
    """Peak memory of this process, bytes, while it works; Linux counts anew when told to."""
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    work()
    return peak_bytes()


if __name__ == "__main__":
    main()
