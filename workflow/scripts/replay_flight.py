"""Replay one flight with several parameter sets; sets whose files are up to date are left as they are."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.reconstruction import ReconstructionSettings
from fusetune.analyze.replay_flight import replay_saved_flight
from fusetune.analyze.start_choice import StartSettings
from fusetune.analyze.withheld_gaps import WithholdingSettings
from fusetune.ledger import Ledger, key_of

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas", "scipy")


def files_of(name: str) -> list[str]:
    return [file for file in snakemake.output if Path(file).name.startswith(f"{name}.")]


with logged_job(snakemake.log[0]):
    flight = Path(snakemake.input.flight)
    checksum = json.loads((flight / "metadata.json").read_text(encoding="utf-8"))["checksum"]
    params = snakemake.params
    source = [checksum, params.code, dict(params.withheld), dict(params.reconstruction), dict(params.start)]
    ledger = Ledger(snakemake.params.ledger)
    keys = {name: key_of([*source, overrides]) for name, overrides in snakemake.params.sets.items()}
    outdated = [name for name, key in keys.items() if not ledger.is_current(name, key, files_of(name))]
    values = {name: snakemake.params.sets[name] for name in outdated}
    replay_saved_flight(
        flight,
        values,
        Path(snakemake.output[0]).parent,
        withholding=WithholdingSettings.from_mapping(snakemake.params.withheld),
        reconstruction=ReconstructionSettings.from_mapping(snakemake.params.reconstruction),
        start=StartSettings.from_mapping(snakemake.params.start),
    )
    for name in outdated:
        ledger.record(name, keys[name], files_of(name))
    print(f"replayed: {', '.join(outdated) or 'none'}; up to date: {len(keys) - len(outdated)}")
