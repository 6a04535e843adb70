# Where jobs find the package and its compiled kernels, and how a run goes on after one that was killed.
import base64
import os
import shutil
import sys
from pathlib import Path

PROJECT = Path(workflow.basedir)
STATE = Path(".snakemake")
LONGEST_JOB_S = 600.0


def prepend_to_path_list(variable, folder):
    os.environ[variable] = os.pathsep.join([folder, *filter(None, [os.environ.get(variable)])])


# Jobs inherit the environment: they import the package that lies beside this workflow, installed or not.
sys.path.insert(0, str(PROJECT / "src"))
prepend_to_path_list("PYTHONPATH", str(PROJECT / "src"))
# The work is small matrices in sequence: threads of a numerics library would cost their start and gain nothing.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from snakemake.exceptions import WorkflowError

from fusetune.digest import source_digest
from fusetune.errors import UserError
from fusetune.kernel_cache import use_kernel_cache
from fusetune.run_lock import claim_run, wait_for_jobs


def unfinished_files():
    """Files of jobs that never ended, each with the marker that Snakemake keeps for it: its name in base 64, cut at '@'."""
    for marker in STATE.glob("incomplete/**/*"):
        if marker.is_file():
            parts = marker.relative_to(STATE / "incomplete").parts
            name = base64.urlsafe_b64decode("".join(part.removeprefix("@") for part in parts)).decode()
            yield Path(name), marker


def recover_from_interruption():
    """Let a run go on where a killed one stopped.

    Snakemake's lock is a file that outlives a killed process. Whoever gets ours, which the operating system drops with
    its holder, knows that such a file is stale. Jobs that outlived their run are waited for. Snakemake looks for
    unfinished files before it knows the jobs behind a checkpoint; taking such files away makes them be made again.
    """
    if not workflow.is_main_process or not claim_run(STATE):
        return
    if not wait_for_jobs(STATE, 0.0):
        print("Waiting for the jobs that an interrupted run left at work ...", file=sys.stderr)
        if not wait_for_jobs(STATE, LONGEST_JOB_S):
            raise WorkflowError("Jobs of an interrupted run are still at work here; end them and start again.")
    for lock in STATE.glob("locks/*.lock"):
        lock.unlink(missing_ok=True)
    for file, marker in list(unfinished_files()):
        if file.is_dir():
            shutil.rmtree(file)
        else:
            file.unlink(missing_ok=True)
        marker.unlink()


recover_from_interruption()

# Changed sources run again what depends on them.
BASE = (
    "cells.py",
    "csv_file.py",
    "errors.py",
    "files.py",
    "number_settings.py",
    "parquet.py",
    "px4",
    "time_limit.py",
)
REPLAY_SOURCES = (
    "ekf2",
    "save",
    "analyze/flight_phases.py",
    "analyze/reconstruction",
    "analyze/replay_files.py",
    "analyze/replay_flight.py",
    "analyze/replay_settings.py",
    "analyze/settings.py",
    "analyze/start_choice.py",
    "analyze/withheld_gaps.py",
)
DIGEST = {
    "design": source_digest(*BASE, "design"),
    "execute": source_digest(*BASE, "ekf2", "design", "execute"),
    "save": source_digest(*BASE, "save"),
    "replay": source_digest(*BASE, *REPLAY_SOURCES),
    "score": source_digest(*BASE, "ekf2", "save", "analyze"),
    "apply": source_digest(*BASE, "apply"),
    "report": source_digest(*BASE, "apply", "report"),
}

# Kernels are compiled once by a rule; the folder is named by the state of their sources.
KERNELS_READY = os.path.join(use_kernel_cache(), "ready.json")
