"""Put the verdicts of all flights into one table."""

from typing import TYPE_CHECKING, Any

from fusetune.save import write_flights_table
from fusetune.save.discovery import RefusedEntry

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    refused = [RefusedEntry(*entry) for entry in snakemake.params.refused]
    write_flights_table(snakemake.input.folders, snakemake.output.table, snakemake.output.csv, refused)
