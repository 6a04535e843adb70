"""Tell of one flight what is wrong, its sensors' delays and which mission it flew, as far as that is out of date."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.conformance.settings import ConformanceSettings
from fusetune.analyze.health.settings import HealthSettings
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.tell_flight import Asked, tell_flight
from fusetune.running.job import keep_out, logged_job
from fusetune.settings.declaration import built

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    params = snakemake.params
    asked = Asked(
        params.present,
        list(snakemake.input.missions),
        built(ReplaySettings, params.replay),
        built(HealthSettings, params.health),
        built(ConformanceSettings, params.conformance),
        params.code,
    )
    told = tell_flight(snakemake.input.flight, Path(snakemake.output[0]).parent, asked)
    print(f"told: {', '.join(told) or 'nothing, all is up to date'}")
