"""Write the mission plan, one parameter file per set, and the table of sets."""

from typing import TYPE_CHECKING, Any

from fusetune.design import write_design

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    write_design(snakemake.input.mission, snakemake.input.study, "results/design")
