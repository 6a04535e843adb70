"""Score the parameters before and after a change on a flight that came after it."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.apply.history.measure import measure_change
from fusetune.running.job import keep_out, logged_job
from fusetune.settings.declaration import built

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    params = snakemake.params
    measure_change(
        snakemake.input.flight,
        snakemake.input.fidelity,
        Path(snakemake.output[0]),
        params.change["before"],
        params.change["after"],
        built(ReplaySettings, params.replay),
        ScoringSettings(**params.scoring),
    )
