"""What a search found, when all its rounds are done."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.apply.search.found_sets import write_found_sets
from fusetune.apply.search.searched_so_far import SearchedSoFar
from fusetune.running.job import keep_out, logged_job
from fusetune.save import read_present

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    params, given = snakemake.params, snakemake.input
    so_far = SearchedSoFar.of_files(given.on, params.search, params.settings["decision"], given.asked, given.tried)
    found, matters = so_far.found(params.rounds, read_present(given.present).parameters)
    write_found_sets(snakemake.output.found, found)
    matters.write(Path(snakemake.output.found).parent)
    print(f"found: {found.document['parameters_found'] or 'nothing'}")
