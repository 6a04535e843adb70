"""Build the report page out of what the rooms wrote."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.report.former_flights import remove_former_flights
from fusetune.report.page import ReportInput, build_report
from fusetune.running.job import logged_job

if TYPE_CHECKING:
    snakemake: Any

with logged_job(snakemake.log[0]):
    given, page = snakemake.input, Path(snakemake.output[0])
    build_report(
        ReportInput(
            flights_table=given.flights,
            analyze_folders=[Path(scores).parent for scores in given.scores],
            apply_folder=Path(given.decision).parent,
            diagnoses=given.diagnoses,
            flight_pages=given.pages,
            blobs=given.blobs,
            health_table=given.health,
            mission=given.mission,
            missions=given.missions,
        ),
        page,
    )
    flights = {Path(page).stem for page in given.pages}
    for folder in ("flights", "sensors"):
        for one in remove_former_flights(page.parent / "report" / folder, flights):
            print(f"removed, as its log is gone: {one}")
