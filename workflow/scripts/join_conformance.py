"""Split the scores of all flights by manoeuvre and leg, and add up what they made of each mission."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.conformance.mission_totals import write_mission_totals
from fusetune.analyze.conformance.split_scores import write_legs
from fusetune.running.job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    write_legs([Path(scores).parent for scores in snakemake.input.scores], snakemake.output.legs, snakemake.threads)
    write_mission_totals(list(snakemake.input.conformance), snakemake.output.missions)
