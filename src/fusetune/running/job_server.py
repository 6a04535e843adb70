"""One process for a run that has imported what its jobs import, and begins each job as a copy of itself.

Of a short job half is to start Python, to import numerics and to load the compiled estimator. The server does that
once: before it forks for a script, it imports what that script imports. A job is then a process of its own as ever,
with the directory, environment, files and status that it would have had; it ends when who asked for it ends
(`job_client.py`), when the server ends, and with the run.

Nobody has to look after a server: it is known to its run alone, and ends when that does, however it ends. It has no
threads, for a copy would have locks that nobody opens; it gives up as soon as a library starts one.
"""

from __future__ import annotations

import ast
import gc
import importlib
import multiprocessing
import os
import selectors
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import traceback
import types
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from pathlib import Path

from fusetune.running import job_client
from fusetune.running.worker_processes import end_with_parent
from fusetune.storage.files import AnyPath

HAND_OVER_WITHIN_S = 30.0
LONGEST_ADDRESS = 100
"""Characters; systems take some 104 to 108 as the path of a socket."""

MOST_TOLD_BYTES = 1 << 16
"""What a pipe holds."""

_TASKS = Path("/proc/self/task")


@dataclass(frozen=True)
class JobServer:
    """A server that this process has started; it ends when the pipe to it is closed, or this process ends."""

    process: subprocess.Popen[bytes]
    folder: Path

    @property
    def shell(self) -> Path:
        """A shell that hands scripts of Snakemake over to the server, and does all else as the shell itself does."""
        return self.folder / "bash"

    def end(self) -> None:
        """End the server and the jobs that it has started."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


def start_job_server(
    shell: str | None, scripts: AnyPath, ahead: Iterable[str], prepare: str, when: str
) -> JobServer | None:
    """Start a server for the jobs of this process.

    Parameters
    ----------
    shell
        Path of the shell that takes what is no job for the server.
    scripts
        Folder of the scripts of jobs, and of modules that they import beside installed ones.
    ahead
        Names of scripts there: while nobody asks for anything, the server imports what these import.
    prepare
        A function, as `module:function`, that the server calls before jobs begin until it returns True: it loads what
        copies then need not load.
    when
        The module without which there is nothing to load.

    Returns
    -------
    JobServer | None
        `None` where the system has no means for it; jobs then run by themselves.
    """
    if shell is None or not hasattr(os, "fork") or not hasattr(socket, "send_fds"):
        return None
    folder = Path(tempfile.mkdtemp(prefix="fusetune-"))  # only its owner may look into it
    try:
        address = folder / "jobs"
        if len(os.fsencode(address)) > LONGEST_ADDRESS:
            raise OSError("the name of the folder for temporary files is too long for a socket")
        _write_shell(folder / "bash", address, shell)
        with socket.socket(socket.AF_UNIX) as listening:
            # who asks before the server is ready waits; nobody finds that it is not there yet
            listening.bind(os.fspath(address))
            listening.listen(socket.SOMAXCONN)
            number = listening.fileno()
            given = [str(number), str(folder), os.fspath(scripts), prepare, when, *ahead]
            command = [sys.executable, "-P", "-m", __name__, *given]
            # so many threads as Snakemake lets a job of one core have
            environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
            process = subprocess.Popen(command, stdin=subprocess.PIPE, pass_fds=[number], env=environment)
    except OSError:
        shutil.rmtree(folder, ignore_errors=True)
        return None
    return JobServer(process, folder)


def _write_shell(file: Path, address: Path, shell: str) -> None:
    client = [sys.executable, "-I", "-S", job_client.__file__, str(address), shell, sys.executable]
    file.write_text(f'#!/bin/sh\nexec {shlex.join(client)} "$@"\n', encoding="utf-8", errors="surrogateescape")
    file.chmod(0o700)
    if not os.access(file, os.X_OK):
        raise OSError("nothing in the folder for temporary files may be executed")


@dataclass(frozen=True)
class Job:
    """What somebody asks the server to run."""

    script: str
    folder: str
    umask: int
    environment: dict[str, str]
    streams: tuple[int, ...]
    """Descriptors of its standard input, output and error."""

    @classmethod
    def asked_on(cls, connection: socket.socket) -> Job | None:
        """Read a job; `None` where who asks has ended."""
        connection.settimeout(HAND_OVER_WITHIN_S)
        try:
            head, streams, _, _ = socket.recv_fds(connection, job_client.LENGTH_BYTES, 3)
            left = int.from_bytes(head, "little")
            parts = []
            while left and (part := connection.recv(left)):
                parts.append(part)
                left -= len(part)
        except OSError:
            return None
        if left or not parts or len(streams) != 3:
            for stream in streams:
                os.close(stream)
            return None
        script, folder, umask, *variables = map(os.fsdecode, b"".join(parts).split(b"\0"))
        environment = dict(variable.split("=", 1) for variable in variables)
        return cls(script, folder, int(umask), environment, tuple(streams))


@dataclass(frozen=True)
class _Copy:
    """A job at work."""

    process: BaseProcess
    kind: frozenset[str]
    """What its script imports by itself."""
    told: int
    """Descriptor on which it tells what else was imported for it."""


class Server:
    """Takes jobs from a socket, and begins each as a copy of this process, until its standard input ends.

    Parameters
    ----------
    listening
        A socket that listens.
    ahead
        Scripts for which it imports while nobody asks.
    prepare, when
        As of `start_job_server`.
    """

    def __init__(self, listening: socket.socket, ahead: Iterable[AnyPath], prepare: str, when: str) -> None:
        self.listening = listening
        self.prepare, self.when = prepare, when
        self.is_prepared = False
        self.selector = selectors.DefaultSelector()
        self.at_work: dict[socket.socket, _Copy] = {}
        self.imported: set[str] = set()
        self.learned: dict[frozenset[str], list[str]] = {}
        self.ahead = [name for script in ahead for name in sorted(imports_of(Path(script).read_bytes()))]
        # what jobs do when somebody presses Ctrl-C; the server itself ends with its run
        self.interrupt = signal.getsignal(signal.SIGINT)
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def serve(self) -> None:
        """Serve until the run ends."""
        self.selector.register(self.listening, selectors.EVENT_READ, self._accept)
        self.selector.register(sys.stdin, selectors.EVENT_READ, None)
        while True:
            events = self.selector.select(0 if self.ahead else None)
            if not events:
                self._import([self.ahead.pop(0)])
            for key, _ in events:
                if key.data is None:
                    self._end_all()
                    return
                # what one event closes another may be about
                if self.selector.get_map().get(key.fd) is key:
                    key.data()

    def _accept(self) -> None:
        connection, _ = self.listening.accept()
        job = Job.asked_on(connection)
        if job is None or not self._begin(job, connection):
            connection.close()

    def _begin(self, job: Job, connection: socket.socket) -> bool:
        """Begin a job; its end, and that of who asked for it, are waited for by the loop."""
        told, telling = os.pipe()
        try:
            source = Path(job.folder, job.script).read_bytes()
            kind = imports_of(source)
            self._import([*sorted(kind), *self.learned.pop(kind, ())])
            if _has_threads():
                self._refuse_more()
                return False
            context = multiprocessing.get_context("fork")
            process = context.Process(target=self._run, args=(job, source, connection, telling))
            process.start()
        except (OSError, SyntaxError):
            os.close(told)
            return False
        finally:
            os.close(telling)
            for stream in job.streams:
                os.close(stream)
        self.at_work[connection] = _Copy(process, kind, told)
        self.selector.register(process.sentinel, selectors.EVENT_READ, lambda: self._tell_end(connection))
        self.selector.register(connection, selectors.EVENT_READ, lambda: self._end(connection))
        return True

    def _import(self, names: list[str]) -> None:
        """Import modules, and load what there is to load; what fails the job itself will tell."""
        new = [name for name in names if name not in self.imported]
        self.imported.update(new)
        for name in new:
            with suppress(Exception):
                importlib.import_module(name)
        if not self.is_prepared and self.when in sys.modules:
            module, function = self.prepare.split(":")
            with suppress(Exception):
                self.is_prepared = getattr(importlib.import_module(module), function)()
            new.append(module)
        if new:
            # what is here stays: copies need not look through it for rubbish, and so share its memory
            gc.collect()
            gc.freeze()

    def _refuse_more(self) -> None:
        """Leave all jobs to those who ask: a copy would have the locks of threads that it has not."""
        print(
            "A library has started threads: jobs of this run begin by themselves, which takes longer.", file=sys.stderr
        )
        self.selector.unregister(self.listening)
        self.listening.close()

    def _run(self, job: Job, source: bytes, connection: socket.socket, telling: int) -> None:
        """What the copy does: become the process that would have run the script."""
        signal.signal(signal.SIGINT, self.interrupt)
        self.listening.close()
        for other in self.at_work:
            other.close()
        for number, stream in enumerate(job.streams):
            os.dup2(stream, number)
            os.close(stream)
        threading.Thread(target=end_with_parent, daemon=True).start()
        os.chdir(job.folder)
        os.umask(job.umask)
        os.environ.clear()
        os.environ.update(job.environment)
        tempfile.tempdir = None
        before = set(sys.modules)
        try:
            run_as_main(job.script, source)
        finally:
            names = [name for name in sys.modules if name not in before]
            os.set_blocking(telling, False)
            with suppress(OSError):
                os.write(telling, "\n".join(names).encode())

    def _tell_end(self, connection: socket.socket) -> None:
        copy = self._forget(connection)
        _send_status(copy, connection)
        # the next copy for such a script has it from the start
        self.learned[copy.kind] = os.read(copy.told, MOST_TOLD_BYTES).decode(errors="replace").split()
        self._close(copy)

    def _end(self, connection: socket.socket) -> None:
        """End the job of one who has gone."""
        copy = self._forget(connection)
        copy.process.kill()
        copy.process.join()
        connection.close()
        self._close(copy)

    def _forget(self, connection: socket.socket) -> _Copy:
        copy = self.at_work.pop(connection)
        self.selector.unregister(copy.process.sentinel)
        self.selector.unregister(connection)
        return copy

    def _close(self, copy: _Copy) -> None:
        os.close(copy.told)
        copy.process.close()

    def _end_all(self) -> None:
        for copy in self.at_work.values():
            copy.process.kill()
        # who hears nothing would run the job by itself
        for connection, copy in self.at_work.items():
            _send_status(copy, connection)


def _send_status(copy: _Copy, connection: socket.socket) -> None:
    """Wait for a job that ends, and say how it ended."""
    copy.process.join()
    status = copy.process.exitcode
    assert status is not None
    with suppress(OSError):
        connection.sendall(status.to_bytes(job_client.STATUS_BYTES, "little", signed=True))
    connection.close()


def imports_of(source: bytes) -> frozenset[str]:
    """Names of the modules that a script imports, wherever in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module)
    return frozenset(names)


def run_as_main(script: str, source: bytes) -> None:
    """Run a script as Python runs the one that it is started with."""
    main = types.ModuleType("__main__")
    main.__dict__.update(__file__=script, __builtins__=__builtins__)
    sys.modules["__main__"], sys.argv[:] = main, [script]
    try:
        exec(compile(source, script, "exec"), main.__dict__)
    except SystemExit:
        raise
    except BaseException as error:
        trace = error.__traceback__
        traceback.print_exception(type(error), error, trace and trace.tb_next)
        raise SystemExit(1) from None


def _has_threads() -> bool:
    """Whether this process has others than that which runs this."""
    return len(os.listdir(_TASKS)) > 1 if _TASKS.is_dir() else threading.active_count() > 1


def main(descriptor: str, folder: str, scripts: str, prepare: str, when: str, *ahead: str) -> None:
    """Serve on a socket that listens, then take its folder away."""
    sys.path.append(scripts)
    try:
        files = [Path(scripts, name) for name in ahead]
        Server(socket.socket(fileno=int(descriptor)), files, prepare, when).serve()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
