"""Build the report page out of what the rooms wrote."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.report.former_flights import remove_former_flights
from fusetune.report.page import build_report
from fusetune.running.job import logged_job

if TYPE_CHECKING:
    snakemake: Any

with logged_job(snakemake.log[0]):
    build_report(
        Path(snakemake.input.flights),
        [Path(scores).parent for scores in snakemake.input.scores],
        [Path(figure) for figure in snakemake.input.figures],
        Path(snakemake.input.decision).parent,
        Path(snakemake.input.summary[0]).parent,
        Path(snakemake.output[0]),
        list(snakemake.input.diagnoses),
        list(snakemake.input.pages),
        snakemake.input.fleet,
        snakemake.input.mission,
        snakemake.input.missions,
    )
    flights = {Path(page).stem for page in snakemake.input.pages}
    report = Path(snakemake.input.summary[0]).parent
    for folder in ("flights", "sensors"):
        for one in remove_former_flights(report / folder, flights):
            print(f"removed, as its log is gone: {one}")
