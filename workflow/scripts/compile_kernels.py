"""Compile the estimator into the cache that all later jobs load it from."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.ekf2.warm_up import compile_kernels
from job import logged_job

if TYPE_CHECKING:
    snakemake: Any

with logged_job(snakemake.log[0]):
    compile_kernels(Path(snakemake.output[0]))
