"""What a search found, when all its rounds are done."""

from typing import TYPE_CHECKING, Any

from fusetune.apply.search.found_sets import write_found_sets
from fusetune.apply.search.search_jobs import SearchedSoFar, tried_files
from fusetune.apply.search.searched_flights import read_searched_flights
from fusetune.apply.settings import DecisionSettings
from fusetune.design.search_settings import SearchSettings
from fusetune.save import read_present
from fusetune.settings.declaration import built

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    params, on = snakemake.params, read_searched_flights(snakemake.input.on)
    so_far = SearchedSoFar(
        on,
        built(SearchSettings, params.search),
        DecisionSettings(**params.settings["decision"]),
        snakemake.input.asked,
        tried_files(snakemake.input.tried, on.flights),
    )
    found = so_far.found(params.rounds, read_present(snakemake.input.present).parameters)
    write_found_sets(snakemake.output[0], found)
    print(f"found: {found.document['parameters_found'] or 'nothing'}")
