"""The process that jobs are copies of: what they are given, what they give back, and who ends when somebody dies."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fusetune.running.job_client import script_in
from fusetune.running.job_server import JobServer, imports_of, start_job_server

pytestmark = pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="asks /proc whether a process runs")

PATIENCE_S = 30.0
RUN = """
import os, sys, time
from pathlib import Path
from fusetune.running.job_server import start_job_server
server = start_job_server(sys.argv[1], Path("."), (), "json:dumps", "nothing")
print(server.process.pid, server.shell, flush=True)
time.sleep(600)
"""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as Snakemake runs jobs in."""
    (tmp_path / ".snakemake" / "scripts").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def server(place: Path) -> Iterator[JobServer]:
    (place / "known.py").write_text("LOADED = []\ndef load():\n    LOADED.append(1)\n    return True\n")
    (place / "deep.py").write_text("import colorsys\n")
    server = start_job_server("/bin/bash", place, (), "known:load", "known")
    assert server is not None
    yield server
    server.end()
    assert not server.folder.exists()


def begin(shell: Path | str, place: Path, script: str, **options: object) -> subprocess.Popen[str]:
    """Ask for a script as Snakemake does."""
    file = place / ".snakemake" / "scripts" / "tmp.job.py"
    file.write_text(script)
    command = [str(shell), "-c", f"set -euo pipefail;  {sys.executable} {file}"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)  # type: ignore[call-overload]


def run(shell: Path | str, place: Path, script: str, **options: object) -> tuple[int, str]:
    job = begin(shell, place, script, **options)
    printed = job.communicate(timeout=PATIENCE_S)[0]
    return job.returncode, printed


def is_running(process: int) -> bool:
    try:
        with open(f"/proc/{process}/stat", encoding="ascii") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def wait_until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def test_a_job_is_as_one_that_python_starts(server: JobServer, place: Path) -> None:
    said = (
        "import os, sys, multiprocessing, tempfile\n"
        "umask = os.umask(0)\n"
        "print(sys.argv, __file__, os.getcwd(), oct(umask), os.environ['GIVEN'], tempfile.gettempdir(), flush=True)\n"
        "print(sys.modules['__main__'].__file__, __name__, file=sys.stderr)\n"
        "if __name__ == '__main__':\n"
        "    import atexit\n"
        "    raise SystemExit(7)\n"
    )
    (place / "temporary").mkdir()
    options = {"env": os.environ | {"GIVEN": "for it", "TMPDIR": str(place / "temporary")}, "umask": 0o027}
    ours, alone = (run(shell, place, said, **options) for shell in (server.shell, "/bin/bash"))
    assert ours == alone
    assert ours[0] == 7
    parents = [int(run(shell, place, "import os; print(os.getppid())")[1]) for shell in (server.shell, "/bin/bash")]
    assert parents[0] == server.process.pid != parents[1]


def test_what_fails_shows_where_and_what_is_killed_is_killed(server: JobServer, place: Path) -> None:
    status, printed = run(server.shell, place, "def f():\n    return 1 / 0\nf()\n")
    assert status == 1
    assert printed.startswith("Traceback (most recent call last):\n")
    assert "in f" in printed
    assert "job_server" not in printed
    assert printed.endswith("ZeroDivisionError: division by zero\n")
    assert run(server.shell, place, "import os; os.kill(os.getpid(), 9)")[0] == -signal.SIGKILL
    assert run(server.shell, place, "import nothing_of_the_kind")[0] == 1
    # a mistake of one job is none of the next
    assert run(server.shell, place, "print(2)") == (0, "2\n")


def test_what_jobs_import_is_there_for_the_next(server: JobServer, place: Path) -> None:
    script = (
        "import sys\nthere = 'colorsys' in sys.modules\nimport known\n__import__('deep')\nprint(there, known.LOADED)"
    )
    assert run(server.shell, place, script) == (0, "False [1]\n")
    # the first copy told what its script does not say itself
    assert run(server.shell, place, script) == (0, "True [1]\n")


def test_all_else_goes_to_the_shell(server: JobServer) -> None:
    for command in ("echo $((1 + 1)); exit 3", f"set -euo pipefail; {sys.executable} -c 'print(2)'; exit 3"):
        done = subprocess.run([server.shell, "-c", command], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (3, "2\n")
    prefix = "set -euo pipefail;  "
    assert script_in(["-c", f"{prefix}py /a/.snakemake/scripts/x.py"], "py") == "/a/.snakemake/scripts/x.py"
    assert script_in(["-c", f"{prefix}py '/a b/.snakemake/scripts/x.py'"], "py") == "/a b/.snakemake/scripts/x.py"
    for other in ("py2 /.snakemake/scripts/x.py", "py /other/x.py", "py .snakemake/scripts/$(x).py", "py '", ""):
        assert script_in(["-c", prefix + other], "py") is None


def test_without_a_server_a_job_runs_by_itself(server: JobServer, place: Path) -> None:
    server.process.kill()
    server.process.wait()
    assert run(server.shell, place, "print(3)") == (0, "3\n")


SLEEPS = "import os, time\nprint(os.getpid(), flush=True)\ntime.sleep(600)\n"


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_job_ends_with_who_asked_for_it(server: JobServer, place: Path, number: int) -> None:
    # ignored where tests run in the background, and what is ignored is inherited
    job = begin(server.shell, place, SLEEPS, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    assert job.stdout is not None
    copy = int(job.stdout.readline())
    assert is_running(copy)
    job.send_signal(number)
    assert job.wait(PATIENCE_S) == -number
    wait_until(lambda: not is_running(copy))


def test_a_job_of_a_server_that_is_killed_ends_and_is_done_anew(server: JobServer, place: Path) -> None:
    job = begin(server.shell, place, SLEEPS)
    assert job.stdout is not None
    copy = int(job.stdout.readline())
    server.process.kill()
    again = int(job.stdout.readline())
    assert again == job.pid
    assert not is_running(copy)
    job.kill()
    job.wait()


def test_nobody_outlives_a_run_that_is_killed(place: Path) -> None:
    parent = subprocess.Popen([sys.executable, "-c", RUN, "/bin/bash"], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    server, shell = parent.stdout.readline().split()
    # it has another parent, and so is not told by that
    job = begin(shell, place, SLEEPS)
    assert job.stdout is not None
    copy = int(job.stdout.readline())
    parent.kill()
    parent.wait()
    wait_until(lambda: not is_running(copy) and not is_running(int(server)))
    wait_until(lambda: not Path(shell).parent.exists())
    # nor does who asked do it by itself
    assert job.wait(PATIENCE_S) == -signal.SIGKILL


def test_imports_are_found_wherever_they_stand() -> None:
    source = b"import a.b, c\nfrom d.e import f\nfrom . import g\ndef h():\n    import i as j\n"
    assert imports_of(source) == {"a.b", "c", "d.e", "i"}
