"""Replay one flight with several parameter sets; sets whose files are up to date are left as they are."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.replaying.replay_flight import replay_saved_flight
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.replaying.store.ledger import ReplayLedger
from fusetune.settings.declaration import built

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas", "scipy")
with logged_job(snakemake.log[0]):
    params = snakemake.params
    flight, folder = Path(snakemake.input.flight), Path(snakemake.output[0]).parent
    ledger = ReplayLedger(flight, folder, [params.code, dict(params.replay)])
    outdated = ledger.outdated(params.sets)
    replay_saved_flight(flight, outdated, folder, built(ReplaySettings, params.replay))
    ledger.record(outdated)
    print(f"replayed: {', '.join(outdated) or 'none'}; up to date: {len(params.sets) - len(outdated)}")
