"""Write the mission plan, one parameter file per set, and the table of sets."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.design.outputs import write_design
from fusetune.design.parameter_sets import ParameterSet
from fusetune.running.job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    if snakemake.output.around:
        # also where the flights lead to no set
        Path(snakemake.output.around[0]).mkdir(parents=True, exist_ok=True)
    around = [ParameterSet(**one) for one in snakemake.params.around]
    folder = Path(snakemake.output.plan).parent
    write_design(snakemake.input.mission, snakemake.input.study, folder, around, snakemake.params.release)
