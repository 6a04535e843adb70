"""What pages are made of: libraries as their authors published them, and scripts that a strict policy lets act."""

import hashlib
import re
from pathlib import Path

import pytest

from fusetune.report.page_shell.assets import ASSETS

UPLOT = ASSETS / "vendor" / "uplot"
SCRIPTS = sorted(file for file in ASSETS.rglob("*.js") if "vendor" not in file.parts)


def test_uplot_is_the_published_one() -> None:
    """By the SHA-256 of the files of the npm package 1.6.32, which its README repeats."""
    told = dict(re.findall(r"^([0-9a-f]{64})  (\S+)$", (UPLOT / "README.md").read_text(encoding="utf-8"), re.M))
    found = {
        hashlib.sha256(file.read_bytes()).hexdigest(): file.name
        for file in UPLOT.iterdir()
        if file.suffix in (".js", ".css")
    }
    assert told == found
    assert "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f" in found
    assert "uPlot (v1.6.32)" in (UPLOT / "uPlot.iife.min.js").read_text(encoding="utf-8")[:200]
    assert "MIT License" in (UPLOT / "LICENSE").read_text(encoding="utf-8")


@pytest.mark.parametrize("file", SCRIPTS, ids=lambda file: file.name)
def test_scripts_make_no_markup_of_text_and_leave_no_globals(file: Path) -> None:
    """Names of flights and sets come from logs: they are never read as HTML, nor as code."""
    text = file.read_text(encoding="utf-8")
    for word in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "new Function", "cssText"):
        assert word not in text
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.S).strip()
    assert code.startswith("(() => {")
    assert code.endswith("})();")
    assert '"use strict";' in code[:40]
    assert not re.search(r"\b(?:window|globalThis)\.(?!fusetune\b)\w+ *=[^=]", code)
