"""Draw the figures of all flights, and write their page."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from fusetune.report.fleet_page.page import build_fleet_page
from fusetune.running.job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]), TemporaryDirectory() as figures:
    build_fleet_page(
        snakemake.input.fleet,
        snakemake.input.health,
        figures,
        snakemake.output[0],
        list(snakemake.input.pages),
        {"The decision": Path(snakemake.output[0]).with_name("report.html")},
    )
