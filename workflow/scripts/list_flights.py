"""Put the verdicts of all flights into one table."""

from typing import TYPE_CHECKING, Any

from fusetune.save import write_flights_table

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    write_flights_table(snakemake.input.folders, snakemake.output.table, snakemake.output.csv)
