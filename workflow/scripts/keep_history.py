"""Keep the decision in the history of its vehicle, and what flights show of the changes before it."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.apply.history.keep import keep_history
from fusetune.apply.settings import DecisionSettings
from fusetune.running.job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    measured: dict[str, list[Path]] = {}
    for folder in map(Path, snakemake.input.measured):
        measured.setdefault(snakemake.params.changes[folder.name], []).append(folder)
    table = Path(snakemake.input.flights)
    keep_history(
        Path(snakemake.input.decision).parent,
        table,
        table.parent,
        measured,
        Path(snakemake.params.history),
        Path(snakemake.output[0]),
        DecisionSettings(**snakemake.params.decision),
    )
