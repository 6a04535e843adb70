"""Evaluate a covariance design and write its tables and figures."""

from typing import TYPE_CHECKING, Any

from fusetune.covariance_design import make_covariance_design
from fusetune.running.job import logged_job

if TYPE_CHECKING:
    snakemake: Any

with logged_job(snakemake.log[0]):
    make_covariance_design(snakemake.input.design, snakemake.output[0])
