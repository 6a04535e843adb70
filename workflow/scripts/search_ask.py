"""What all searches ask for in a round, from what flights answered in the rounds before."""

from typing import TYPE_CHECKING, Any

from fusetune.apply.search.round_files import write_round
from fusetune.apply.search.search_jobs import SearchedSoFar, tried_files
from fusetune.apply.search.searched_flights import read_searched_flights
from fusetune.apply.settings import DecisionSettings
from fusetune.design.search_settings import SearchSettings
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
    asked = so_far.asked_in(params.number)
    write_round(snakemake.output[0], asked)
    print(so_far.told(asked))
