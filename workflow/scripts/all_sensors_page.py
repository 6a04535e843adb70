"""Draw each sensor over all flights, and write their page."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.report.flight_page.sensor_page import build_pooled_sensor_page
from fusetune.running.job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    folders = [Path(file).parent for file in snakemake.input.noise]
    page = Path(snakemake.output[0])
    build_pooled_sensor_page(folders, page, {"The decision": page.parents[1] / "report.html"})
