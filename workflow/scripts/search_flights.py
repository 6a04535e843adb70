"""Find the flights that can be searched on: those of the vehicle whose replay is trusted."""

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.analyze.analyze_flight import AnalysisSettings
from fusetune.apply.search.flights_to_search import flights_to_search
from fusetune.apply.search.searched_flights import write_searched_flights
from fusetune.apply.settings import DecisionSettings
from fusetune.design.search_settings import SearchSettings
from fusetune.running.job import keep_out, logged_job
from fusetune.running.worker_processes import worker_processes
from fusetune.save import read_present
from fusetune.settings.declaration import built

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")

if __name__ == "__main__":
    with logged_job(snakemake.log[0]), ExitStack() as stack:
        params = snakemake.params
        analysis = built(AnalysisSettings, {key: params.settings[key] for key in ("replay", "scoring", "trust")})
        folders = {Path(folder).name: Path(folder) for folder in snakemake.input.folders}
        processes = min(snakemake.threads, len(folders))
        mapping = map
        if processes > 1:
            mapping = stack.enter_context(worker_processes(processes)).map
        found = flights_to_search(
            folders,
            snakemake.input.flights,
            read_present(snakemake.input.present).flight,
            SearchSettings(parameters=tuple(params.parameters)),
            DecisionSettings(**params.settings["decision"]),
            analysis,
            mapping,
        )
        write_searched_flights(snakemake.output[0], found)
        print(f"searched on: {', '.join(found.flights) or 'no flight'}")
        print(*(f"{name}: left out, {why}" for name, why in found.left_out.items()), sep="\n")
