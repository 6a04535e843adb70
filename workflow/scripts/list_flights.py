"""Put the verdicts of all flights into one table, and write down what the vehicle flies now."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.save import find_present, write_flights_table, write_present
from fusetune.save.discovery import RefusedEntry

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    params, folders = snakemake.params, [Path(folder) for folder in snakemake.input.folders]
    refused = [RefusedEntry(*entry) for entry in params.refused]
    rows = write_flights_table(folders, snakemake.output.table, snakemake.output.csv, refused)
    present = find_present(rows, {folder.name: folder for folder in folders}, params.varied, params.present_flight)
    write_present(snakemake.output.present, present)
