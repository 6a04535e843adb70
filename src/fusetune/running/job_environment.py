"""Environment variables of a job's process, which must be there before it starts."""

from __future__ import annotations

import os

LARGE_ARRAY_BYTES = 1 << 22

JOB_ENVIRONMENT = {
    # The work is small matrices in sequence: threads of a numerics library would cost their start and gain nothing.
    "OPENBLAS_NUM_THREADS": "1",
    # Of Arrow's memory pools this one, which is not the one in use, would start a thread when Arrow is imported.
    "JE_ARROW_MALLOC_CONF": "background_thread:false",
    # The C library of Linux would come to keep freed arrays of up to 32 MB; of less than 4 MB it may, for to ask the
    # system for each takes longer than to calculate with it. Other systems do not know these.
    "MALLOC_MMAP_THRESHOLD_": str(LARGE_ARRAY_BYTES),
    "MALLOC_TRIM_THRESHOLD_": str(LARGE_ARRAY_BYTES),
}


def use_job_environment() -> None:
    """Let the children of this process have them, where the user has not set them otherwise."""
    for name, value in JOB_ENVIRONMENT.items():
        os.environ.setdefault(name, value)
