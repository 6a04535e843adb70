# What a job takes of memory and time, told from the sizes of the logs it works on, so that no more jobs run at once than
# `--resources mem_mb=` allows and a cluster keeps enough for each. Memory is about what `benchmarks/long_flights.py`
# measures and a third more; jobs that run out of either get twice as much at the next attempt, where there is one.
import os

KERNELS_MB = 350  # Python, its libraries and the compiled estimator
LIBRARIES_MB = 200
DIAGNOSED_MB_PER_MB = 7.0  # of a flight that is diagnosed, for each MB of its log
THREAD_MB_PER_MB = 1.0  # of a set that is replayed and scored beside others
MOST_THREADS_OF_A_FLIGHT = 8
SEARCHED_MB_PER_MB = 8.0  # of a flight on which sets are tried in memory, for each MB of its log
MOST_PREPARED = 12  # flights that a process of a search holds
JOINED_AT_ONCE = 2  # flights whose scores are split by manoeuvre at a time
JOINED_MB_PER_SET = 0.2  # of each of them
DECIDED_MB_PER_PAIR = 0.1  # of a flight and a set that it was scored with
SIMULATED_LOG_MB = 10.0  # of a flight that is not simulated yet


def log_mb(flight):
    """Size of a flight's log, MB; of one that is not there it is that of the demonstration's."""
    try:
        return os.path.getsize(LOGS[flight]) / 1e6
    except OSError:
        return SIMULATED_LOG_MB


def of_its_logs(fixed, for_each_mb=0.0):
    """Resource function: a fixed part and one for each MB of the job's log, or of all where it is no job of a flight."""

    def needed(wildcards, attempt):
        flight = getattr(wildcards, "flight", None)
        size = sum(log_mb(one) for one in ([flight] if flight else LOGS))
        return round((fixed + for_each_mb * size) * attempt)

    return needed


def of_the_largest_log(fixed, for_each_mb):
    """Resource function of a job that works on one log after the other."""
    return lambda wildcards, attempt: round((fixed + for_each_mb * max(map(log_mb, LOGS), default=0.0)) * attempt)


def of_several_logs(threads):
    """Memory, MB, of a job that holds several flights in each of its processes."""
    return lambda wildcards, attempt: round(
        threads * (KERNELS_MB + SEARCHED_MB_PER_MB * sum(sorted(map(log_mb, LOGS))[-MOST_PREPARED:])) * attempt
    )


def replay_resources(replayed, scored=0, threads=1):
    """Memory, MB, and time, minutes, of a job that replays some sets and scores some."""
    return {
        "mem_mb": of_its_logs(KERNELS_MB, 5.0 + 0.03 * scored + THREAD_MB_PER_MB * (threads - 1)),
        "runtime": of_its_logs(10, 0.02 * (replayed + scored)),
    }
