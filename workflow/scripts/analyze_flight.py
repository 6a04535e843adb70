"""Replay one flight with the sets that are out of date, score all sets, and grade how far the replay can be trusted."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from threadpoolctl import threadpool_limits

from fusetune.analyze.analyze_flight import AnalysisSettings, MadeWith, analyze_flight
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.trust.settings import TrustSettings
from fusetune.running.job import keep_out, logged_job
from fusetune.set_names import FOUND
from fusetune.settings.declaration import built
from fusetune.storage.documents import read_document

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
# Snakemake lets numerics have as many threads as the job: for small matrices they cost time, and change the last bits
with logged_job(snakemake.log[0]), threadpool_limits(1):
    params = snakemake.params
    flight, folder = Path(snakemake.input.flight), Path(snakemake.output[0]).parent
    found = read_document(snakemake.input.found)["on_flights"].get(flight.name) if snakemake.input.found else None
    searched = {FOUND: found} if found is not None else {}
    sets, scored = {**params.sets, **searched}, [*params.scored, *searched]
    settings = AnalysisSettings(
        built(ReplaySettings, params.replay),
        ScoringSettings(**params.scoring),
        TrustSettings(**params.trust),
    )
    made = analyze_flight(
        flight,
        folder,
        sets,
        scored,
        present=params.present,
        settings=settings,
        made_with=MadeWith(params.code, params.score_code),
        threads=snakemake.threads,
    )
    print(f"replayed or scored: {', '.join(made) or 'none'}; up to date: {len({*sets, *scored}) - len(made)}")
