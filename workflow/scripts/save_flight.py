"""Turn a log into a folder of tables with metadata and a verdict; a bad log becomes a refusal."""

from typing import TYPE_CHECKING, Any

from fusetune.errors import RUN_AGAIN
from fusetune.px4.ulog.reading_limits import ReadingLimits
from fusetune.running.job import keep_out, logged_job
from fusetune.save import VerdictThresholds, save_log
from fusetune.storage.checksum_file import check_checksum

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    thresholds = VerdictThresholds(**snakemake.params.thresholds)
    limits = ReadingLimits(**snakemake.params.limits)
    flown, folder, release = snakemake.params.flown, snakemake.output[0], snakemake.params.release
    if flown is None:
        check_checksum(snakemake.input.log, RUN_AGAIN)
        verdict = save_log(snakemake.input.log, folder, thresholds, limits, release=release)
    else:
        checksum = snakemake.params.checksum
        shown = flown["shown"]
        verdict = save_log(flown["path"], folder, thresholds, limits, shown=shown, checksum=checksum, release=release)
    print(f"{snakemake.wildcards.flight}: {verdict.status}", *verdict.reasons, sep="\n")
