"""Replay one flight with the present parameters, where that is out of date, and estimate the sensors' delays."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.delays.flight_delays import write_delays
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.replaying.store.ledger import ReplayLedger
from fusetune.settings.declaration import built

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    params = snakemake.params
    flight, folder = Path(snakemake.input.flight), Path(snakemake.output.delays).parent
    ledger = ReplayLedger(flight, folder, [params.code, dict(params.replay)])
    outdated = ledger.outdated(params.sets)
    write_delays(flight, folder, outdated, built(ReplaySettings, params.replay))
    ledger.record(outdated)
    print(f"replayed: {', '.join(outdated) or 'none'}; up to date: {len(params.sets) - len(outdated)}")
