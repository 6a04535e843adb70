"""Tell of one flight which mission it flew, leg by leg, and its manoeuvres."""

from typing import TYPE_CHECKING, Any

from fusetune.analyze.conformance.conformance_files import write_conformance
from fusetune.analyze.conformance.settings import ConformanceSettings
from fusetune.settings.declaration import built

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    write_conformance(
        snakemake.input.flight,
        snakemake.input.track,
        list(snakemake.input.missions),
        snakemake.output[0],
        built(ConformanceSettings, snakemake.params.settings),
    )
