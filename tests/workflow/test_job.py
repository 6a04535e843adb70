"""What every job does around its work."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "workflow" / "scripts"

WORKS_WITHOUT = """
import sys
from job import keep_out
keep_out("pandas", "scipy")
import numba, numpy as np, pyarrow as pa
table = pa.table({"a": np.arange(3), "b": pa.array([1.0, None, 3.0])})
print(table["a"].to_numpy().sum(), numba.njit(lambda x: x + 1)(1), {"pandas", "scipy"} & set(sys.modules))
"""


def run(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], cwd=SCRIPTS, capture_output=True, text=True, check=False)


def test_tables_and_kernels_do_without_what_is_kept_out() -> None:
    done = run(WORKS_WITHOUT)
    assert done.stdout.split("\n")[0] == "3 2 set()", done.stderr


@pytest.mark.parametrize("package", ["pandas", "pandas.testing"])
def test_what_is_kept_out_and_yet_needed_is_told_by_name(package: str) -> None:
    done = run(f"from job import keep_out\nkeep_out('pandas')\nimport {package}")
    assert f"{package.partition('.')[0]} is kept out of this process" in done.stderr
