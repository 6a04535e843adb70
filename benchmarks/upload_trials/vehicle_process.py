"""The process of one or several vehicles: `python -m benchmarks.upload_trials.vehicle_process SETTINGS`, a JSON text.

It prints the address to connect to, and when its standard input ends, what happened to each vehicle, as JSON.
"""

from __future__ import annotations

import json
import os
import select
import socket
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from benchmarks.upload_trials.air import Air, Schedule
from benchmarks.upload_trials.vehicle import Faults, Traits, Vehicle
from pymavlink.dialects.v20 import common


@dataclass
class Settings:
    """What the process is told.

    Attributes
    ----------
    vehicles : keywords of their `Traits`
    port : the ground station's, to which UDP goes
    way : "udp", "tcp" or "pty"
    others : also a ground station and a companion are heard
    pace : factor of all times of the vehicles
    dropped_s : a TCP connection is cut after so long, and may be made anew; 0: never
    """

    vehicles: list[dict[str, Any]]
    port: int = 0
    way: str = "udp"
    others: bool = False
    pace: float = 0.05
    seed: int = 1
    loss: float = 0.0
    double: float = 0.0
    delay_s: tuple[float, float] = (0.0, 0.0)
    dropped_s: float = 0.0


def main(settings: Settings) -> None:
    """Run until the standard input ends."""
    schedule, made = Schedule(), []
    if settings.way == "udp":
        lines: list[Any] = [_Datagrams(settings.port) for _ in settings.vehicles]
        address = f"udp:{settings.port}"
    else:
        lines = [_Connection() if settings.way == "tcp" else _Pty()]
        address = lines[0].address
    if settings.dropped_s and settings.way == "tcp":
        schedule.after(settings.dropped_s, lines[0].drop)
    for number, keywords in enumerate(settings.vehicles):
        faults = Faults(**keywords.pop("faults", {}))
        values = {name: (kind, bits) for name, (kind, bits) in keywords.pop("values").items()}
        ways = [
            Air(settings.seed * 100 + number * 10 + way, schedule, settings.loss, settings.double, settings.delay_s)
            for way in (1, 2)
        ]
        send = lines[number % len(lines)].send
        made.append(Vehicle(Traits(values=values, faults=faults, **keywords), schedule, settings.pace, *ways, send))
    if settings.others:
        _others(schedule, settings.pace, lines[0].send)
    print(address, flush=True)
    _run(schedule, lines, made)
    print(json.dumps([_report(one) for one in made]), flush=True)


def _run(schedule: Schedule, lines: list[Any], vehicles: list[Vehicle]) -> None:
    parsers = [common.MAVLink(None) for _ in lines]
    for parser in parsers:
        parser.robust_parsing = True
    while True:
        idle_s = schedule.run_due()
        watched = [one.file for one in lines if one.file is not None]
        ready, _, _ = select.select([sys.stdin, *watched], [], [], idle_s)
        if sys.stdin in ready:
            return
        for number, line in enumerate(lines):
            if line.file in ready:
                for message in parsers[number].parse_buffer(line.receive()) or ():
                    for vehicle in vehicles if len(lines) == 1 else [vehicles[number]]:
                        vehicle.take(message)


def _others(schedule: Schedule, pace: float, send: Callable[[bytes], None]) -> None:
    """A ground station and a companion computer on the same link."""
    ground, companion = common.MAVLink(None, 254, 190), common.MAVLink(None, 1, 191)

    def beat() -> None:
        send(common.MAVLink_heartbeat_message(common.MAV_TYPE_GCS, 8, 0, 0, 0, 3).pack(ground))
        armed = common.MAV_MODE_FLAG_SAFETY_ARMED
        send(common.MAVLink_heartbeat_message(common.MAV_TYPE_ONBOARD_CONTROLLER, 8, armed, 0, 0, 3).pack(companion))
        schedule.after(pace, beat)

    beat()


class _Datagrams:
    def __init__(self, port: int) -> None:
        self.file: Any = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.file.bind(("127.0.0.1", 0))
        self._to = ("127.0.0.1", port)

    def send(self, data: bytes) -> None:
        self.file.sendto(data, self._to)

    def receive(self) -> bytes:
        try:
            return self.file.recv(65536)
        except ConnectionError:
            return b""


class _Connection:
    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.address = f"tcp:127.0.0.1:{self._server.getsockname()[1]}"
        self._peer: socket.socket | None = None
        self.file: Any = self._server

    def send(self, data: bytes) -> None:
        if self._peer is not None:
            try:
                self._peer.sendall(data)
            except OSError:
                self.drop()

    def receive(self) -> bytes:
        if self._peer is None:
            self._peer, _ = self._server.accept()
            self.file = self._peer
            return b""
        try:
            data = self._peer.recv(65536)
        except OSError:
            data = b""
        if not data:
            self.drop()
        return data

    def drop(self) -> None:
        if self._peer is not None:
            self._peer.close()
        self._peer, self.file = None, self._server


class _Pty:
    def __init__(self) -> None:
        import tty

        master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(master, False)
        self.address = os.ttyname(self._slave)
        self.file: Any = master

    def send(self, data: bytes) -> None:
        # where nobody reads, as on a line that is not plugged in, it is lost
        with suppress(BlockingIOError):
            os.write(self.file, data)

    def receive(self) -> bytes:
        return os.read(self.file, 65536)


def _report(vehicle: Vehicle) -> dict[str, Any]:
    now = {name: bits for name, (_, bits) in vehicle.values.items()}
    saved = {name: bits for name, (_, bits) in vehicle.saved.items()}
    return {
        "values": now,
        "saved": saved,
        "history": {name: seen for name, seen in vehicle.history.items() if len(seen) > 1},
        "sets": vehicle.sets,
        "reboots": vehicle.reboots,
    }


if __name__ == "__main__":
    main(Settings(**json.loads(sys.argv[1])))
