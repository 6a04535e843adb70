"""A page printed to PDF by a browser that is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from fusetune.errors import UserError
from fusetune.storage.files import AnyPath, atomic_path

BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "microsoft-edge",
    "microsoft-edge-stable",
    "msedge",
    "brave-browser",
)
"""Names on PATH of browsers that print without a window."""

APPLICATIONS = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
)
"""Where macOS has them, which puts none on PATH."""

LONGEST_S = 120.0


def print_page(page: AnyPath, output: AnyPath) -> None:
    """Print a page to PDF.

    Raises
    ------
    UserError
        There is no such browser, or it prints nothing.
    """
    browser = _browser()
    if browser is None:
        raise UserError(
            page,
            "cannot be printed to PDF: there is no Chromium, Chrome or Edge on PATH",
            "Install one (apt install chromium, brew install --cask chromium), or open the page in any browser and "
            "print it from its menu (Ctrl+P, Save as PDF)",
        )
    with atomic_path(output) as temporary, tempfile.TemporaryDirectory(prefix="fusetune_print_") as profile:
        command = [
            browser,
            "--headless",
            "--disable-gpu",
            "--no-pdf-header-footer",
            f"--user-data-dir={profile}",
            f"--print-to-pdf={temporary.resolve()}",
            # as root, in a container, there is no sandbox to be had
            *(["--no-sandbox"] if sys.platform != "win32" and os.geteuid() == 0 else []),
            Path(page).resolve().as_uri(),
        ]
        try:
            done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=LONGEST_S)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise _failed(page, browser, str(error)) from error
        if not (temporary.is_file() and temporary.read_bytes().startswith(b"%PDF")):
            said = done.stderr.strip().splitlines()
            raise _failed(page, browser, said[-1] if said else f"status {done.returncode}")


def _browser() -> str | None:
    found = (shutil.which(name) for name in BROWSERS)
    installed = (name for name in APPLICATIONS if os.access(name, os.X_OK))
    return next(filter(None, found), None) or next(installed, None)


def _failed(page: AnyPath, browser: str, why: str) -> UserError:
    remedy = "Open the page in any browser and print it from its menu"
    return UserError(page, f"is not printed by {browser} ({why})", remedy)
