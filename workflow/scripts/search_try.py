"""Replay what a search asks of flights in a round; what was tried before, in whatever run, is not tried again."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.analyze_flight import AnalysisSettings
from fusetune.apply.search.round_files import read_round
from fusetune.apply.search.searched_flights import read_searched_flights
from fusetune.apply.search.tried_round import try_round
from fusetune.apply.settings import DecisionSettings
from fusetune.running.job import keep_out, logged_job
from fusetune.settings.declaration import built

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")

if __name__ == "__main__":
    with logged_job(snakemake.log[0]):
        params, output = snakemake.params, Path(snakemake.output[0])
        saved = snakemake.input.folders
        folders = {Path(folder).name: Path(folder) for folder in ([saved] if isinstance(saved, str) else saved)}
        tried = {output.stem: output}
        if snakemake.input.get("on"):
            flights = read_searched_flights(snakemake.input.on).flights
            folders, tried = (
                {name: folders[name] for name in flights},
                {name: output / f"{name}.json" for name in flights},
            )
            output.mkdir(parents=True, exist_ok=True)
        told = try_round(
            read_round(snakemake.input.asked),
            folders,
            tried,
            params.kept,
            DecisionSettings(**params.settings["decision"]),
            built(AnalysisSettings, {key: params.settings[key] for key in ("replay", "scoring")}),
            snakemake.threads,
        )
        print(*told, sep="\n")
