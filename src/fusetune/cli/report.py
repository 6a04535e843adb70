"""`fusetune report`."""

from __future__ import annotations

import argparse
from pathlib import Path

from fusetune.cli.command import DONE
from fusetune.cli.output.json_document import add_json, print_document

HELP = "build the page of a folder of results anew, and print it to PDF"
EXAMPLES = (
    ("fusetune report results", "results/report.html, by this release"),
    ("fusetune report results --out tuning.html --pdf tuning.pdf", "elsewhere, and as PDF"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Results, page, PDF."""
    parser.add_argument("results", type=Path, metavar="RESULTS", help="folder results of a run")
    parser.add_argument("--out", type=Path, metavar="FILE.html", help="page to write (report.html in RESULTS)")
    parser.add_argument(
        "--pdf",
        type=Path,
        nargs="?",
        const=Path(),
        metavar="FILE.pdf",
        help="print the page, too (beside it), with an installed Chromium, Chrome or Edge",
    )
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Build, and print; always `DONE`."""
    from fusetune.apply.results_folder import results_folder
    from fusetune.report.results_page import write_results_page

    page = write_results_page(results_folder(options.results), options.out)
    pdf = None
    if options.pdf is not None:
        from fusetune.report.printed_page import print_page

        pdf = page.with_suffix(".pdf") if options.pdf == Path() else options.pdf
        print_page(page, pdf)
    if options.json:
        print_document({"page": page, "pdf": pdf})
        return DONE
    print(page if pdf is None else f"{page}\n{pdf}")
    return DONE
