"""The style sheets and scripts of a page, joined, and the policy that lets nothing but them act."""

from __future__ import annotations

import base64
import hashlib
from dataclasses import dataclass
from pathlib import Path

ASSETS = Path(__file__).parents[1] / "page_assets"

STYLES = ("page.css", "charts.css")
SCRIPTS = ("state.js", "theme.js", "tabs.js", "glossary.js", "scroll.js")
"""In this order: the first one makes what the others add to."""

VIEWER_FOLDERS = ("vendor/uplot", "viewer")
"""Needed where a page shows a flight."""


@dataclass(frozen=True)
class Assets:
    """One style sheet and one script."""

    style: str
    script: str

    @property
    def policy(self) -> str:
        """Content-Security-Policy: no network, and of styles and scripts these two alone."""
        return (
            "default-src 'none'; img-src data:; "
            f"style-src '{_hash(self.style)}'; script-src '{_hash(self.script)}'; base-uri 'none'; form-action 'none'"
        )


def joined_assets(*, viewer: bool) -> Assets:
    """All style sheets and scripts a page needs, with those of the flight viewer or without."""
    folders = VIEWER_FOLDERS if viewer else ()
    styles = [*_existing(STYLES), *_of_folders(folders, "*.css")]
    scripts = [*_existing(SCRIPTS), *_of_folders(folders, "*.js")]
    return Assets(_joined(styles), _joined(scripts).replace("</script", "<\\/script"))


def _existing(names: tuple[str, ...]) -> list[Path]:
    return [file for name in names if (file := ASSETS / name).is_file()]


def _of_folders(folders: tuple[str, ...], pattern: str) -> list[Path]:
    return [file for folder in folders for file in sorted((ASSETS / folder).glob(pattern))]


def _joined(files: list[Path]) -> str:
    return "\n".join(file.read_text(encoding="utf-8") for file in files)


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
