"""Fly the mission with a simulated vehicle and write its log."""

from typing import TYPE_CHECKING, Any

from fusetune.design.missions.mission import load_mission
from fusetune.execute import simulate
from fusetune.execute.sensors.faults import parse_faults
from fusetune.execute.vehicle import load_vehicle
from fusetune.running.job import keep_out, logged_job
from fusetune.storage.checksum_file import write_checksum

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    simulate(
        load_mission(snakemake.input.mission),
        load_vehicle(snakemake.input.vehicle),
        snakemake.params.overrides,
        snakemake.params.seed,
        parse_faults(snakemake.params.faults, "config/config.yaml"),
        snakemake.output[0],
    )
    write_checksum(snakemake.output[0])
