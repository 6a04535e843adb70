"""Draw one flight: track, test ratios over time."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.report.figures.flight_figures import plot_flight
from fusetune.running.job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    plot_flight(
        Path(snakemake.input.flight),
        Path(snakemake.input.scores).parent,
        snakemake.params.sets,
        Path(snakemake.output[0]),
        present=snakemake.params.present,
    )
