"""Pack what the viewer shows of a flight, and write its page, where that is out of date."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusetune.report.flight_data.write_blob import write_blob
from fusetune.report.flight_page.page import build_flight_page
from fusetune.running.job import keep_out, logged_job
from fusetune.save.flight_folder import METADATA_FILE
from fusetune.storage.documents import read_document
from fusetune.storage.files import sha256_of
from fusetune.storage.ledger import Ledger, key_of

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]):
    given, page, blob = snakemake.input, Path(snakemake.output.page), Path(snakemake.output.blob)
    ledger = Ledger(page.with_name(f".{page.stem}.made.json"))
    # which log it was, and what is said of it, stand in its metadata; what was replayed, in its scores
    shown = [Path(given.flight, METADATA_FILE), *given.told, given.track, given.conformance]
    shown += [given.scores] if given.scores else []
    params = snakemake.params
    chosen = read_document(given.decision)["chosen"] if given.decision else None
    sets = [*([chosen] if chosen else []), *params.sets]
    key = key_of([params.code, params.save_code, sets, *map(sha256_of, shown)])
    if ledger.is_current(page.name, key, [page, blob]):
        print("up to date")
    else:
        analyzed = Path(given.diagnosis).parent
        large = page.with_name(f".{page.stem}.large.blob")
        try:
            write_blob(given.flight, analyzed, blob, large, sets)
            build_flight_page(analyzed, page, {"The decision": page.parents[2] / "report.html"}, large.read_bytes())
        finally:
            large.unlink(missing_ok=True)
        ledger.record(page.name, key, [page, blob])
