"""Draw a flight and its sensors, and write its page, where that is out of date."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from fusetune.report.flight_page.page import build_drawn_flight_page
from fusetune.running.job import keep_out, logged_job
from fusetune.save.flight_folder import METADATA_FILE
from fusetune.storage.files import sha256_of
from fusetune.storage.ledger import Ledger, key_of

if TYPE_CHECKING:
    snakemake: Any

keep_out("pandas")
with logged_job(snakemake.log[0]), TemporaryDirectory() as figures:
    given, page = snakemake.input, Path(snakemake.output[0])
    results = page.parents[2]
    ledger = Ledger(page.with_name(f".{page.stem}.made.json"))
    # which log it was, and what is said of it, stand in its metadata
    drawn = [Path(given.flight, METADATA_FILE), *given.told, given.track, given.conformance]
    key = key_of([snakemake.params.code, snakemake.params.save_code, *map(sha256_of, drawn)])
    if ledger.is_current(page.name, key, [page]):
        print("up to date")
    else:
        build_drawn_flight_page(
            given.flight,
            Path(given.diagnosis).parent,
            figures,
            page,
            {"The decision": results / "report.html", "All flights": results / "fleet.html"},
        )
        ledger.record(page.name, key, [page])
