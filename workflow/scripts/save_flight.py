"""Turn a log into a folder of tables with metadata and a verdict; a bad log becomes a refusal."""

from typing import TYPE_CHECKING, Any

from fusetune.save import VerdictThresholds, save_log

from job import keep_out, logged_job

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    thresholds = VerdictThresholds.from_mapping(snakemake.params.thresholds)
    flown, folder = snakemake.params.flown, snakemake.output[0]
    if flown is None:
        verdict = save_log(snakemake.input.log, folder, thresholds)
    else:
        checksum = snakemake.params.checksum
        verdict = save_log(flown["path"], folder, thresholds, shown=flown["shown"], checksum=checksum)
    print(f"{snakemake.wildcards.flight}: {verdict.status}", *verdict.reasons, sep="\n")
