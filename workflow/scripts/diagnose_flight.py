"""Tell of one flight what is wrong, how healthy sensors and filter were, and what single effects it shows."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.diagnose_flight import diagnose_flight
from fusetune.analyze.health.settings import HealthSettings
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.settings.declaration import built

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    found = diagnose_flight(
        snakemake.input.flight,
        Path(snakemake.output[0]).parent,
        replay=built(ReplaySettings, snakemake.params.replay),
        health=built(HealthSettings, snakemake.params.health),
    )
    for one in found:
        print(f"{one.severity}: {one.cause} ({one.confidence:.0%})")
