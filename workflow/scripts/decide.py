"""Rank the sets over all flights, decide, and write the parameter files."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.apply.decide import decide
from fusetune.apply.settings import DecisionSettings
from fusetune.save import read_present

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    now = read_present(snakemake.input.present)
    decide(
        [Path(scores).parent for scores in snakemake.input.scores],
        Path(snakemake.input.flights),
        Path(snakemake.output[0]).parent,
        sets=snakemake.params.sets,
        present=snakemake.params.present,
        newest_flight=now.flight,
        same_present=now.same,
        descriptions=snakemake.params.descriptions,
        configuration_files=[Path(file) for file in snakemake.input.configuration],
        delays=Path(snakemake.input.delays) if snakemake.input.delays else None,
        settings=DecisionSettings(**snakemake.params.decision),
    )
