"""Draw the sensors of a flight, and write their page."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.report.flight_page.sensor_page import build_sensor_page
from fusetune.running.job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    build_sensor_page(
        snakemake.input.flight,
        Path(snakemake.input.noise).parent,
        snakemake.output[0],
        {"The flight": Path(snakemake.output[0]).parents[1] / "flights" / f"{snakemake.wildcards.flight}.html"},
    )
