"""Runs the notebooks of the documentation, so that what they show is what the code gives."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path
from typing import NamedTuple

import nbformat
from nbclient import NotebookClient
from nbconvert import MarkdownExporter

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = ROOT / "docs" / "notebooks"
FLIGHTS = ROOT / "results" / "execute"
"""Where the demonstration of the pipeline leaves its logs."""


class RunNotebook(NamedTuple):
    """A notebook that ran: its text with results as Markdown, and the pictures that this shows, by name."""

    name: str
    markdown: str
    pictures: dict[str, bytes]


def run_notebook(file: Path, flights: Path = FLIGHTS) -> RunNotebook:
    """Run a notebook in a folder of its own, in which the logs are in `flights/`.

    Raises
    ------
    FileNotFoundError
        There are no logs.
    nbclient.exceptions.CellExecutionError
        A cell failed.
    """
    logs = sorted(flights.glob("*.ulg"))
    if not logs:
        raise FileNotFoundError(f"{flights} holds no logs: run `make demonstration` with an empty flights/ first")
    notebook = nbformat.read(file, as_version=4)
    with tempfile.TemporaryDirectory(prefix="fusetune_notebook_") as scratch:
        (Path(scratch) / "flights").mkdir()
        for log in logs:
            shutil.copy(log, Path(scratch) / "flights")
        # this Python, whatever kernels the user has
        os.environ.setdefault("JUPYTER_PLATFORM_DIRS", "1")
        NotebookClient(notebook, timeout=600, resources={"metadata": {"path": scratch}}).execute()
    exporter = MarkdownExporter()
    text, resources = exporter.from_notebook_node(notebook, {"output_files_dir": f"{file.stem}_files"})
    return RunNotebook(file.stem, text, dict(resources["outputs"]))
