"""Flips single bits in files of results and looks whether who reads them notices.

    python benchmarks/flipped_bits.py RESULTS_DIR [--flips 300] [--seed 1]

RESULTS_DIR is the folder of a finished run; nothing in it is changed. Of every kind of file as many bits are flipped,
one at a time in a copy, and the copy is read as later jobs read it. Each flip ends in one of three ways: it is told
with the file's name; the same values are read as before; or, what must not be, other values are read. Files that no
later job reads (pictures, pages, parameter files) are counted beside, and so are ledgers, whose entries only ever save
work and name the digests of the files they vouch for.
Ends with status 1 where a flip was silent. Prints also what the checks cost: the time of reading all tables and
documents with them over the time without.
"""

from __future__ import annotations

import argparse
import csv
import json
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from fusetune.errors import RUN_AGAIN, UserError
from fusetune.storage.checksum_file import check_checksum, checksum_file
from fusetune.storage.documents import read_document
from fusetune.storage.parquet import read_table

TOLD, SAME, SILENT = "told", "same values", "SILENT"


def table_values(file: Path) -> bytes:
    """All values of a table, as bytes that are equal only where every bit of the values is."""
    table = read_table(file)
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table.combine_chunks())
    return sink.getvalue().to_pybytes()


def document_values(file: Path) -> str:
    """A document as text."""
    return json.dumps(read_document(file))


def checked_bytes(file: Path) -> bytes:
    """A file with its checksum beside it."""
    check_checksum(file, RUN_AGAIN)
    return file.read_bytes()


READERS: dict[str, Callable[[Path], object]] = {
    "tables (.parquet)": table_values,
    "documents (.json)": document_values,
    "files with a checksum (.csv, .ulg)": checked_bytes,
    "checksums (.sha256)": lambda file: checked_bytes(file.with_suffix("")),
}


def kind_of(file: Path) -> str | None:
    """The kind of a file, or None where no later job reads it."""
    if file.suffix == ".parquet":
        return "tables (.parquet)"
    if file.suffix == ".json" and not file.name.startswith("."):
        return "documents (.json)"
    if checksum_file(file).is_file():
        return "files with a checksum (.csv, .ulg)"
    return "checksums (.sha256)" if file.suffix == ".sha256" else None


def outcome_of(file: Path, kind: str, bit: int, scratch: Path) -> str:
    """How a reader takes a file in which one bit was flipped."""
    together = {file, file.with_suffix("") if file.suffix == ".sha256" else checksum_file(file)}
    for one in together:
        if one.is_file():
            shutil.copy(one, scratch / one.name)
    content = bytearray(file.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    (scratch / file.name).write_bytes(content)
    try:
        values = READERS[kind](scratch / file.name)
    except UserError as error:
        return TOLD if Path(error.file).name == file.name.removesuffix(".sha256") else SILENT
    return SAME if values == READERS[kind](file) else SILENT


def flip(results: Path, flips: int, seed: int) -> dict[str, Counter[str]]:
    """Outcomes of flipped bits by kind of file; the kinds take turns, within one every file is as likely."""
    chance = random.Random(seed)
    by_kind: dict[str, list[Path]] = {}
    for file in sorted(results.rglob("*")):
        kind = kind_of(file) if file.is_file() else None
        if kind is not None and file.stat().st_size:
            by_kind.setdefault(kind, []).append(file)
    outcomes: dict[str, Counter[str]] = {kind: Counter() for kind in sorted(by_kind)}
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(flips if by_kind else 0):
            kind = sorted(by_kind)[turn % len(by_kind)]
            file = chance.choice(by_kind[kind])
            bit = chance.randrange(8 * file.stat().st_size)
            outcomes[kind][outcome_of(file, kind, bit, Path(folder))] += 1
    return outcomes


def cost_of_checks(results: Path, runs: int = 5) -> float:
    """Processor time of reading all tables and documents with the checks over that without."""
    tables = sorted(results.rglob("*.parquet"))
    documents = [file for file in sorted(results.rglob("*.json")) if not file.name.startswith(".")]

    def checked() -> None:
        for file in tables:
            read_table(file)
        for file in documents:
            read_document(file)

    def unchecked() -> None:
        for file in tables:
            with pq.ParquetFile(file, memory_map=True) as parquet:
                parquet.read(use_threads=False)
        for file in documents:
            json.loads(file.read_text(encoding="utf-8"))

    def seconds(way: Callable[[], None]) -> float:
        begin = time.process_time()
        way()
        return time.process_time() - begin

    times = [(seconds(checked), seconds(unchecked)) for _ in range(runs)]
    return min(one for one, _ in times) / min(one for _, one in times)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path, metavar="RESULTS_DIR")
    parser.add_argument("--flips", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    outcomes = flip(options.results, options.flips, options.seed)
    writer = csv.writer(sys.stdout, delimiter="\t", lineterminator="\n")
    writer.writerow(["kind", TOLD, SAME, SILENT])
    for kind, counts in outcomes.items():
        writer.writerow([kind, counts[TOLD], counts[SAME], counts[SILENT]])
    unread = Counter(file.suffix for file in options.results.rglob("*") if file.is_file() and kind_of(file) is None)
    print("read by no later job:", ", ".join(f"{count} {suffix}" for suffix, count in sorted(unread.items())))
    print(f"reading with the checks takes {cost_of_checks(options.results):.2f} times the time without")
    return 1 if any(counts[SILENT] for counts in outcomes.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
