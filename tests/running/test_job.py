"""What every job does around its work."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

WORKS_WITHOUT = """
import sys
from fusetune.running.job import keep_out
keep_out("pandas", "scipy")
import numba, numpy as np, pyarrow as pa
table = pa.table({"a": np.arange(3), "b": pa.array([1.0, None, 3.0])})
print(table["a"].to_numpy().sum(), numba.njit(lambda x: x + 1)(1), {"pandas", "scipy"} & set(sys.modules))
"""


SERVED = """
from pathlib import Path
from snakemake.shell import shell
from fusetune.running.job_server import start_job_server

onstart:
    global server
    server = start_job_server(shell.get_executable(), Path("."), (), "json:dumps", "nothing")
    shell.executable(server.shell)

onsuccess:
    assert Path("parent").read_text() == f"{server.process.pid} 2"

rule all:
    default_target: True
    output: "parent"
    params: of={"one": 2}
    script: "job_of_it.py"
"""


def test_scripts_as_snakemake_starts_them_are_copies_of_the_server(tmp_path: Path) -> None:
    (tmp_path / "Snakefile").write_text(SERVED)
    script = "import os\nopen(snakemake.output[0], 'w').write(f\"{os.getppid()} {snakemake.params.of['one']}\")\n"
    (tmp_path / "job_of_it.py").write_text(script)
    command = [sys.executable, "-m", "snakemake", "--cores", "1"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "AssertionError" not in done.stderr


def run(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


def test_tables_and_kernels_do_without_what_is_kept_out() -> None:
    done = run(WORKS_WITHOUT)
    assert done.stdout.split("\n")[0] == "3 2 set()", done.stderr


@pytest.mark.parametrize("package", ["pandas", "pandas.testing"])
def test_what_is_kept_out_and_yet_needed_is_told_by_name(package: str) -> None:
    done = run(f"from fusetune.running.job import keep_out\nkeep_out('pandas')\nimport {package}")
    assert f"{package.partition('.')[0]} is kept out of this process" in done.stderr
