"""Rank the sets over all flights, decide, and write the parameter files."""

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.apply.decide import decide
from fusetune.apply.settings import DecisionSettings
from fusetune.running.job import keep_out, logged_job
from fusetune.save import read_present
from fusetune.set_names import FOUND
from fusetune.storage.documents import read_document
from fusetune.storage.files import atomic_path

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    now, found = read_present(snakemake.input.present), None
    sets, descriptions = snakemake.params.sets, snakemake.params.descriptions
    settings, folder = DecisionSettings(**snakemake.params.decision), Path(snakemake.output[0]).parent
    if snakemake.input.found:
        # it brings what searches think with
        from fusetune.apply.search.found_sets import (
            DESCRIPTION,
            read_found_sets,
            search_decision,
            write_search_document,
        )

        found = read_found_sets(snakemake.input.found)
        sets, descriptions = [*dict.fromkeys([*sets, *found.decided])], {**descriptions, FOUND: DESCRIPTION}
        settings = search_decision(settings)
    decide(
        [Path(scores).parent for scores in snakemake.input.scores],
        Path(snakemake.input.flights),
        folder,
        sets=sets,
        present=snakemake.params.present,
        newest_flight=now.flight,
        same_present=now.same,
        descriptions=descriptions,
        configuration_files=[Path(file) for file in snakemake.input.configuration],
        delays=Path(snakemake.input.delays) if snakemake.input.delays else None,
        effects=snakemake.input.effects or None,
        diagnoses=list(snakemake.input.diagnoses),
        legs=snakemake.input.legs,
        recommended=found.recommended if found is not None else None,
        saved=Path(snakemake.input.flights).parent,
        settings=settings,
    )
    if found is not None:
        write_search_document(snakemake.output.search, found, read_document(folder / "decision.json"))
        # what all sets of the search tell, in place of what these two do
        with atomic_path(folder / "sensitivity.json") as temporary:
            shutil.copyfile(snakemake.input.matters, temporary)
