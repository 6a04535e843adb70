"""Turn a log into a folder of tables with metadata and a verdict; a bad log becomes a refusal."""

from typing import TYPE_CHECKING, Any

from fusetune.checksum_file import check_checksum
from fusetune.errors import RUN_AGAIN
from fusetune.save import VerdictThresholds, save_log

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    if snakemake.params.simulated:
        check_checksum(snakemake.input.log, RUN_AGAIN)
    thresholds = VerdictThresholds.from_mapping(snakemake.params.thresholds)
    verdict = save_log(snakemake.input.log, snakemake.output[0], thresholds)
    print(f"{snakemake.wildcards.flight}: {verdict.status}", *verdict.reasons, sep="\n")
