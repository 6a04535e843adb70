"""Starts the process of a vehicle, and asks it afterwards what happened."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).resolve().parents[2]


class RunningVehicle:
    """A vehicle at work.

    Attributes
    ----------
    address : to connect to
    """

    def __init__(self, settings: dict[str, Any]) -> None:
        if settings.get("way", "udp") == "udp":
            settings = {"port": free_port(), **settings}
        paths = [str(_ROOT), str(_ROOT / "src"), os.environ.get("PYTHONPATH", "")]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
        command = [sys.executable, "-m", "benchmarks.upload_trials.vehicle_process", json.dumps(settings)]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=environment, cwd=_ROOT)
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().strip()
        if not self.address:
            raise RuntimeError("the vehicle did not start")
        self._reports: list[dict[str, Any]] | None = None

    def reports(self) -> list[dict[str, Any]]:
        """End it; what each vehicle holds, and what was sent to it."""
        if self._reports is None:
            output, _ = self._process.communicate("", timeout=20.0)
            self._reports = json.loads(output)
        return self._reports

    def end(self) -> None:
        """End it, whatever it does."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.communicate()


@contextmanager
def vehicle_running(*vehicles: dict[str, Any], **settings: Any) -> Iterator[RunningVehicle]:
    """One or several vehicles, by keywords of their `Traits`; `settings` of the process."""
    running = RunningVehicle({"vehicles": list(vehicles), **settings})
    try:
        yield running
    finally:
        running.end()


def free_port() -> int:
    """A UDP port that is free now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
