"""The ways to a vehicle: UDP, TCP and serial lines, as bytes that come from somewhere and go there.

pymavlink's own connections are not used: its UDP answers whoever spoke last, which with two vehicles may be the other
one, and its reconnecting and its messages on the screen cannot be told.
"""

from __future__ import annotations

import select
import socket
import time
from contextlib import suppress
from typing import Any, Protocol

from fusetune.apply.upload.stops import Refusal
from fusetune.errors import UserError

Source = Any
"""Who speaks on a link: the address of a datagram, or the link itself."""

FORMS = "udp:14550, udp:host:port, tcp:host:port, or a serial port such as /dev/ttyACM0 or COM3,57600"
_BAUD = 57600
"""Of PX4's TELEM1 and of telemetry radios; USB has none, and takes any."""
_LARGEST = 65536


class Link(Protocol):
    """A way to a vehicle.

    Attributes
    ----------
    name : as it was given
    sources : who has spoken, or who is to be spoken to first
    """

    name: str
    sources: set[Source]

    def receive(self, timeout_s: float) -> list[tuple[Source, bytes]]:
        """What has come, waiting for it if there is nothing; a broken link gives nothing, and is tried again."""

    def send(self, data: bytes, source: Source) -> None:
        """Send, or lose, as links do."""

    def close(self) -> None:
        """Leave it."""


def open_link(address: str) -> Link:
    """The link of an address of one of the `FORMS`.

    Raises
    ------
    UserError
        It is of none of the forms.
    Refusal
        It cannot be opened.
    """
    kind, _, rest = address.partition(":")
    try:
        if kind == "udp":
            host, _, port = rest.rpartition(":")
            return UdpLink(address, host, _port(address, port))
        if kind == "tcp":
            host, _, port = rest.rpartition(":")
            return TcpLink(address, host or "127.0.0.1", _port(address, port))
        device, _, baud = address.partition(",")
        if not device or (baud and not baud.isdigit()):
            raise UserError(address, "is no address of a vehicle", f"Give {FORMS}")
        return SerialLink(address, device, int(baud or _BAUD))
    except OSError as error:
        raise Refusal(
            f"{address} cannot be opened ({error})", "Is it in use, as by QGroundControl, or not there"
        ) from None


def _port(address: str, text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 0 < int(text) < 65536:
        raise UserError(address, "names no port", f"Give {FORMS}")
    return int(text)


class UdpLink:
    """Datagrams: to a port of ours, from whoever sends, or to a host that is spoken to first."""

    def __init__(self, name: str, host: str, port: int) -> None:
        self.name = name
        self.sources: set[Source] = set()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            if host:
                self.sources.add((socket.gethostbyname(host), port))
                self._socket.bind(("", 0))
            else:
                self._socket.bind(("", port))
        except OSError:
            self._socket.close()
            raise
        self._socket.setblocking(False)

    def receive(self, timeout_s: float) -> list[tuple[Source, bytes]]:
        """All datagrams that are there."""
        received: list[tuple[Source, bytes]] = []
        select.select([self._socket], [], [], max(timeout_s, 0.0))
        with suppress(BlockingIOError, InterruptedError, ConnectionError):
            while len(received) < 1000:
                data, source = self._socket.recvfrom(_LARGEST)
                self.sources.add(source)
                received.append((source, data))
        return received

    def send(self, data: bytes, source: Source) -> None:
        """One datagram; what the system does not take is lost."""
        with suppress(OSError):
            self._socket.sendto(data, source)

    def close(self) -> None:
        """Leave the port."""
        self._socket.close()


class TcpLink:
    """A connection, made again when it breaks."""

    _AGAIN_S = 0.5

    def __init__(self, name: str, host: str, port: int) -> None:
        self.name = name
        self.sources: set[Source] = {name}
        self._address = (host, port)
        self._socket: socket.socket | None = None
        self._connect()

    def _connect(self) -> None:
        self._socket = socket.create_connection(self._address, timeout=5.0)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.settimeout(2.0)

    def receive(self, timeout_s: float) -> list[tuple[Source, bytes]]:
        """What has come; while the connection is broken nothing."""
        if self._socket is None:
            time.sleep(min(max(timeout_s, 0.0), self._AGAIN_S))
            with suppress(OSError):
                self._connect()
            return []
        try:
            readable, _, _ = select.select([self._socket], [], [], max(timeout_s, 0.0))
            data = self._socket.recv(_LARGEST) if readable else None
        except OSError:
            data = b""
        if data == b"":
            self._broken()
        return [(self.name, data)] if data else []

    def send(self, data: bytes, source: Source) -> None:
        """Send whole, or break."""
        if self._socket is not None:
            try:
                self._socket.sendall(data)
            except OSError:
                self._broken()

    def _broken(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def close(self) -> None:
        """End the connection."""
        self._broken()


class SerialLink:
    """A serial line, by pyserial, opened again when it was unplugged."""

    _AGAIN_S = 0.5
    _LONGEST_READ_S = 0.1

    def __init__(self, name: str, device: str, baud: int) -> None:
        try:
            import serial
        except ImportError:
            raise UserError(
                name, "needs pyserial, which is not installed", "Install it: pip install 'fusetune[upload]'"
            ) from None
        self.name = name
        self.sources: set[Source] = {name}
        self._make = lambda: serial.Serial(
            device, baud, timeout=self._LONGEST_READ_S, write_timeout=2.0, exclusive=True
        )
        self._port: Any = self._make()

    def receive(self, timeout_s: float) -> list[tuple[Source, bytes]]:
        """What has come; while the line is unplugged nothing."""
        if self._port is None:
            time.sleep(min(max(timeout_s, 0.0), self._AGAIN_S))
            with suppress(OSError):
                self._port = self._make()
            return []
        try:
            self._port.timeout = min(max(timeout_s, 0.0), self._LONGEST_READ_S)
            data = self._port.read(max(self._port.in_waiting, 1))
        except OSError:
            self.close()
            return []
        return [(self.name, data)] if data else []

    def send(self, data: bytes, source: Source) -> None:
        """Send whole, or break."""
        if self._port is not None:
            try:
                self._port.write(data)
            except OSError:
                self.close()

    def close(self) -> None:
        """Leave the line."""
        with suppress(OSError):
            if self._port is not None:
                self._port.close()
        self._port = None
