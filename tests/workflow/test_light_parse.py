"""Reading the workflow costs Snakemake, and every job that reads it again, no numerics."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

HEAVY = ("numpy", "numba", "pandas", "pyarrow", "scipy")


def test_what_the_rules_import_brings_no_numerics(project_root: Path) -> None:
    files = [project_root / "workflow/Snakefile", *(project_root / "workflow/rules").glob("*.smk")]
    text = "\n".join(file.read_text(encoding="utf-8") for file in files)
    modules = sorted(set(re.findall(r"^from (fusetune[\w.]*) import", text, re.M)))
    assert "fusetune.analyze.replaying.store.parts" in modules
    code = f"import sys, {', '.join(modules)}; print([name for name in {HEAVY} if name in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_what_jobs_import_brings_no_pandas() -> None:
    """PyArrow looks for it when the first table is made, so a module that makes one brings it to every process."""
    modules = (
        "fusetune.analyze.analyze_flight, fusetune.analyze.evaluate, fusetune.apply.decide, fusetune.save.log_folder"
    )
    code = f"import sys, {modules}; print('pandas' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"
