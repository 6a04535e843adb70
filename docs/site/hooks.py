"""Hooks of MkDocs: pages that lie outside docs/, notebooks that are run, and links that lead out of the site."""

from __future__ import annotations

import os
import posixpath
import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
OUTSIDE = {
    "README.md": "index.md",
    "config/README.md": "configuration.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "benchmarks/README.md": "benchmarks.md",
}
"""Files of the project that are pages of the site, and where they stand in it."""
_LINK = re.compile(r"(!?\[[^\]]*\]\()([^)\s#]+)(#[^)\s]*)?\)")
_SITE = Path(__file__).resolve().parent


def on_files(files: Files, config: Any) -> Files:
    """Add what lies outside docs/, and the notebooks as they ran."""
    for source, page in OUTSIDE.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=with_links(text, source, page)))
    files.append(File.generated(config, "tables.css", content=(_SITE / "tables.css").read_text(encoding="utf-8")))
    for file in [one for one in files if one.src_uri.endswith(".ipynb")]:
        files.remove(file)
    if os.environ.get("FUSETUNE_DOCS_NOTEBOOKS", "run") == "run":
        sys.path.insert(0, str(_SITE))
        from notebooks import NOTEBOOKS, run_notebook

        for notebook in sorted(NOTEBOOKS.glob("*.ipynb")):
            ran = run_notebook(notebook)
            files.append(File.generated(config, f"notebooks/{ran.name}.md", content=ran.markdown))
            for name, content in ran.pictures.items():
                files.append(File.generated(config, f"notebooks/{name}", content=content))
    else:
        for notebook in (_SITE.parent / "notebooks").glob("*.ipynb"):
            content = f"# {notebook.stem}\n\nLeft out of this build.\n"
            files.append(File.generated(config, f"notebooks/{notebook.stem}.md", content=content))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Let links to files that are no pages say where in the project these are."""
    if page.file.src_uri in OUTSIDE.values() or page.file.src_uri.startswith("notebooks/"):
        return markdown
    return with_links(markdown, f"docs/{page.file.src_uri}", page.file.src_uri)


def with_links(text: str, source: str, page: str) -> str:
    """The text with its relative links made those of the site.

    Parameters
    ----------
    source : place of the file in the project, from which its links lead
    page : its place in the site
    """

    def replaced(found: re.Match[str]) -> str:
        head, target, anchor = found[1], found[2], found[3] or ""
        if "://" in target or target.startswith("mailto:"):
            return found[0]
        place = posixpath.normpath(posixpath.join(posixpath.dirname(source), target))
        if place in OUTSIDE:
            return f"{head}{_relative(OUTSIDE[place], page)}{anchor})"
        if place.startswith("docs/"):
            return f"{head}{_relative(place.removeprefix('docs/'), page).replace('.ipynb', '.md')}{anchor})"
        if not (ROOT / place).exists():
            return found[0]  # MkDocs then says that it leads nowhere
        return f"{head.strip('[](').rstrip('](')} (`{place}`)"

    return _LINK.sub(replaced, text)


def _relative(target: str, page: str) -> str:
    return posixpath.relpath(target, posixpath.dirname(page) or ".")
