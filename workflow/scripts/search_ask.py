"""What all searches ask for in a round, from what flights answered in the rounds before."""

from typing import TYPE_CHECKING, Any

from fusetune.apply.search.round_files import write_round
from fusetune.apply.search.searched_so_far import SearchedSoFar
from fusetune.running.job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    params, given = snakemake.params, snakemake.input
    so_far = SearchedSoFar.of_files(given.on, params.search, params.settings["decision"], given.asked, given.tried)
    asked = so_far.asked_in(params.number)
    write_round(snakemake.output[0], asked)
    print(so_far.told(asked))
