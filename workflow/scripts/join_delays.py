"""Join the delays and single effects of all flights and say which of them PX4 is told wrong."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.delays.settings import DelaySettings
from fusetune.analyze.delays.wrong_delays import write_joined
from fusetune.analyze.effects.joined_effects import write_joined_effects
from fusetune.running.job import keep_out, logged_job
from fusetune.save import read_present

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    files = {Path(file).parent.name: file for file in snakemake.input.delays}
    newest = read_present(snakemake.input.present).flight
    settings = DelaySettings(**snakemake.params.settings)
    found = write_joined(files, newest, settings, snakemake.output.delays, flights_table=snakemake.input.flights)
    print(*found, sep="\n")
    told = {Path(file).parent.name: file for file in snakemake.input.effects}
    joined = write_joined_effects(told, newest, snakemake.input.flights, snakemake.output.effects)
    print(*joined.sets.items(), sep="\n")
