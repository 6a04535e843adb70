"""Plan the flight of the mission: its legs, how long it takes, its map."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.design.missions.mission import load_mission
from fusetune.design.missions.outlook import outlook
from fusetune.execute.planned_vehicle import planned_vehicle
from fusetune.report.figures.mission_figure import draw_mission
from fusetune.running.job import logged_job
from fusetune.storage.documents import write_document

if TYPE_CHECKING:
    snakemake: Any

with logged_job(snakemake.log[0]):
    mission = load_mission(snakemake.input.mission)
    vehicle = planned_vehicle(snakemake.input.vehicle[0] if snakemake.input.vehicle else None)
    found = outlook(mission, vehicle, file=snakemake.input.mission)
    draw_mission(mission, vehicle.limits, Path(snakemake.output.map))
    write_document(Path(snakemake.output.outlook), found.document())
