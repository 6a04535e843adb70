"""Put the health of all flights into one table."""

from typing import TYPE_CHECKING, Any

from fusetune.analyze.health.health_files import write_health_table
from fusetune.running.job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    write_health_table(list(snakemake.input), snakemake.output[0])
