"""Put the health and the diagnoses of all flights together."""

from typing import TYPE_CHECKING, Any

from fusetune.apply.fleet.fleet import write_fleet
from fusetune.running.job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    write_fleet(snakemake.input.health, list(snakemake.input.diagnoses), snakemake.output[0])
