# Where jobs find the package and its compiled kernels, and how a run goes on after one that was killed.
import atexit
import logging
import os
import signal
import sys
from functools import cache
from pathlib import Path

# Where this file lies; a workflow that takes this one as a module lies elsewhere.
WORKFLOW = Path(workflow.current_basedir.get_path_or_uri(secret_free=True)).parent
SOURCES = WORKFLOW.parent / "src"
IS_MODULE = not workflow.modifier.is_main_snakefile()
RULES_OF_OTHERS = {*workflow.rules}
STATE = Path(".snakemake")
# A module's results lie below the prefix that it is given. Snakemake puts that before what rules name; what is read or
# written otherwise asks `placed`.
RESULTS = Path(workflow.modifier.modify_path("results"))
LONGEST_JOB_S = 600.0
# With less, Snakemake's own notes cannot be written either, and what it says of that is hard to read.
LEAST_FREE_BYTES = 20_000_000

# Where Snakemake's log cannot be written, the run itself tells of it.
logging.raiseExceptions = False


def end_quietly(number, frame):
    raise SystemExit(128 + number)


# Python would show where it was, which helps nobody. Snakemake ends its jobs on this as on a KeyboardInterrupt.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, end_quietly)


def placed(name):
    """Where a file or folder lies that rules call `results/…`."""
    return str(RESULTS / Path(name).relative_to("results"))


def prepend_to_path_list(variable, folder):
    os.environ[variable] = os.pathsep.join([folder, *filter(None, [os.environ.get(variable)])])


# Jobs inherit the environment: they import the package that lies beside this workflow, installed or not. An installed
# package has its workflow within it; jobs in an environment of conda's find it by a link in a folder that holds nothing else,
# for the libraries beside it are of another environment.
LINKED = Path(os.path.abspath(STATE)) / "fusetune_package"
if SOURCES.is_dir():
    sys.path.insert(0, str(SOURCES))
    prepend_to_path_list("PYTHONPATH", str(SOURCES))
from snakemake.exceptions import WorkflowError
from snakemake.settings.types import DeploymentMethod
from snakemake.shell import shell

try:
    import fusetune
except ModuleNotFoundError:
    raise WorkflowError("This workflow needs the package fusetune: install it beside Snakemake, with pip.") from None

if not SOURCES.is_dir() and DeploymentMethod.CONDA in workflow.deployment_settings.deployment_method:
    prepend_to_path_list("PYTHONPATH", str(LINKED))

from fusetune.running.cluster_jobs import cancel_queued_jobs
from fusetune.storage.content import ContentDigests
from fusetune.errors import UserError, demand_room, write_error
from fusetune.running.job_environment import use_job_environment
from fusetune.running.job_server import start_job_server
from fusetune.running.job_sources import job_digests
from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache
from fusetune.running.recovery import (
    belong_together,
    bind_together,
    link_to,
    remove,
    remove_stale_locks,
    remove_unfinished,
    unfinished_files,
)
from fusetune.running.run_lock import RUN_VARIABLE, claim_run, holder_of, join_run, new_run, wait_for_jobs

CONTENT = ContentDigests(STATE / "fusetune_contents.json")

use_job_environment()


# A job knows by its name the run that it works for.
if workflow.is_main_process:
    RUN = new_run()
if RUN_VARIABLE in os.environ:
    workflow.register_envvars(RUN_VARIABLE)


def cancel_jobs_of_interrupted_run():
    """Jobs that wait in Slurm's queue would start beside those of this run."""
    jobs = cancel_queued_jobs(STATE)
    if jobs:
        numbers = ", ".join(job.number for job in jobs)
        print(
            f"Slurm still had jobs of an interrupted run ({numbers}); they are cancelled and made again.",
            file=sys.stderr,
        )


def told_and_ended(error):
    """End the process with one sentence; Snakemake would tell of an error in an input function as of a programmer's."""
    print(error, file=sys.stderr)
    raise SystemExit(1)


def recover_from_interruption(claim):
    """Let a run go on where a killed one stopped; this process holds the folder."""
    cancel_jobs_of_interrupted_run()
    if not wait_for_jobs(STATE, 0.0):
        print("Waiting for the jobs that an interrupted run left at work ...", file=sys.stderr)
        if not wait_for_jobs(STATE, LONGEST_JOB_S):
            told_and_ended("Jobs of an interrupted run are still at work here. End them and start again.")
    remove_stale_locks(STATE, claim)
    remove_unfinished(unfinished_files(STATE, PRODUCTS))
    if not belong_together(STATE, RESULTS):
        flights = Path(SETTINGS.flights_dir).resolve()
        for part in BELIEVED:
            if part.resolve() not in (flights, *flights.parents):
                remove(part)
        bind_together(STATE, RESULTS)


def tell_what_a_run_would_mend():
    if any(unfinished_files(STATE, PRODUCTS)):
        who = holder_of(STATE) or "it said that it ended"
        print(f"Some files are unfinished: a run is at work here, or was interrupted ({who}).", file=sys.stderr)
    if RESULTS.exists() and not belong_together(STATE, RESULTS):
        print(f"Nothing is known of how {RESULTS}/ was made; the next run makes it again.", file=sys.stderr)


@cache
def job_server():
    """The process of which jobs that this one runs itself are copies, where there can be one."""
    server = start_job_server(
        shell.get_executable(),
        WORKFLOW / "scripts",
        ahead=["save_flight.py", "tell_flight.py", "analyze_flight.py", "flight_page.py"],
        prepare="fusetune.ekf2.replay.warm_up:load_kernels",
        when="fusetune.ekf2.replay.loop",
    )
    if server is not None:
        atexit.register(server.end)
    return server


@cache
def take_the_folder():
    if not workflow.is_main_process:
        return
    # Only to run jobs, to try it, or to touch files is an executor named: not to report, to list, to clean up ...
    if workflow.executor_plugin is None or workflow.dryrun:
        tell_what_a_run_would_mend()
        return
    try:
        for folder in (STATE, RESULTS):
            demand_room(folder, LEAST_FREE_BYTES)
        claim = claim_run(STATE, RUN)
        if not SOURCES.is_dir():
            link_to(Path(fusetune.__file__).parent, LINKED / "fusetune")
        if not claim.locked:
            print("No locks in this file system: after a killed run use snakemake --unlock.", file=sys.stderr)
        elif not workflow.touch:
            recover_from_interruption(claim)
            for log in INPUTS.found.logs:
                CONTENT.of(log.path)
            CONTENT.save()
        if workflow.local_exec and not IS_MODULE:
            # Snakemake 9.27 looks through all jobs again some time after each look where their rate is limited, so
            # with every job that ends it looks once a second more; here jobs begin no faster than others end.
            workflow.scheduling_settings.max_jobs_per_timespan = None
        # it imports while Snakemake looks for what there is to do; jobs of other workflows are none for it
        if not workflow.touch and not IS_MODULE:
            job_server()
    except UserError as error:
        told_and_ended(error)
    except OSError as error:
        told_and_ended(write_error(error, os.getcwd()) or error)


def let_jobs_be_served():
    """Let the jobs that this process runs itself begin as copies of the server."""
    if not workflow.touch and job_server() is not None:
        shell.executable(job_server().shell)


def before_any_job(wildcards):
    """Input function of every rule, which gives no file.

    Snakemake asks for the input of jobs after it has said what it is about to do, and before it looks for locks and
    unfinished files. What is true only for a process that will run jobs is done here.
    """
    take_the_folder()
    return []


if not workflow.is_main_process:
    try:
        join_run(STATE)
    except UserError as error:
        told_and_ended(error)

# Changed sources run again what depends on them.
DIGEST = job_digests()

# Kernels are compiled once by a rule; the folder is named by the state of their sources.
KERNELS_READY = os.path.join(use_kernel_cache(), "ready.json")

# What this workflow makes; and of that, what Snakemake takes for up to date when it has no memory of it. Replays are not
# among it, nor is what a search tried: they are made from a saved flight, and keep a record of their own.
PRODUCTS = [RESULTS, Path(KERNELS_READY)]
BELIEVED = [
    RESULTS / part for part in ("design", "execute", "save", "search", "apply", "change", "report", "report.html")
]
