"""Draw the figures that compare the sets over all flights."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.report.figures.summary_figures import plot_summary
from fusetune.running.job import logged_job

if TYPE_CHECKING:
    snakemake: Any

with logged_job(snakemake.log[0]):
    plot_summary(
        [Path(scores).parent for scores in snakemake.input.scores],
        Path(snakemake.input.decision).parent,
        Path(snakemake.output[0]).parent,
    )
