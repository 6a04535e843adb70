"""Draw a flight and its sensors, and write its page."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from fusetune.report.flight_page.page import build_drawn_flight_page

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]), TemporaryDirectory() as figures:
    build_drawn_flight_page(
        snakemake.input.flight,
        Path(snakemake.input.diagnosis).parent,
        figures,
        snakemake.output[0],
        {"The decision": "results/report.html", "All flights": "results/fleet.html"},
    )
