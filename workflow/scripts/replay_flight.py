"""Replay one flight with several parameter sets; sets whose files are up to date are left as they are."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.replay_flight import replay_flight
from job import logged_job

if TYPE_CHECKING:
    snakemake: Any

with logged_job(snakemake.log[0]):
    replay_flight(
        Path(snakemake.input.flight),
        Path(snakemake.output[0]).parent,
        snakemake.params.sets,
    )
