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

from fusetune.apply.upload.needs import INSTALL
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


class _Line:
    """A link to one vehicle that may break, and is opened anew."""

    _AGAIN_S = 0.5

    def __init__(self, name: str) -> None:
        self.name = name
        self.sources: set[Source] = {name}
        self._end: Any = self._open()

    def _open(self) -> Any:
        """Open it; raises `OSError`."""
        raise NotImplementedError

    def _read(self, timeout_s: float) -> bytes:
        """What has come, after a while nothing; raises `OSError` where it is broken."""
        raise NotImplementedError

    def _write(self, data: bytes) -> None:
        """Send; raises `OSError` where it is broken."""
        raise NotImplementedError

    def receive(self, timeout_s: float) -> list[tuple[Source, bytes]]:
        """What has come; while the line is broken nothing."""
        data = b""
        try:
            if self._end is None:
                time.sleep(min(max(timeout_s, 0.0), self._AGAIN_S))
                self._end = self._open()
            else:
                data = self._read(max(timeout_s, 0.0))
        except OSError:
            self.close()
        return [(self.name, data)] if data else []

    def send(self, data: bytes, source: Source) -> None:
        """Send whole, or break."""
        try:
            if self._end is not None:
                self._write(data)
        except OSError:
            self.close()

    def close(self) -> None:
        """Leave the line."""
        with suppress(OSError):
            if self._end is not None:
                self._end.close()
        self._end = None


class TcpLink(_Line):
    """A connection."""

    def __init__(self, name: str, host: str, port: int) -> None:
        self._address = (host, port)
        super().__init__(name)

    def _open(self) -> socket.socket:
        made = socket.create_connection(self._address, timeout=5.0)
        made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        made.settimeout(2.0)
        return made

    def _read(self, timeout_s: float) -> bytes:
        readable, _, _ = select.select([self._end], [], [], timeout_s)
        if not readable:
            return b""
        data: bytes = self._end.recv(_LARGEST)
        if not data:
            raise ConnectionError("the other side has closed it")
        return data

    def _write(self, data: bytes) -> None:
        self._end.sendall(data)


class SerialLink(_Line):
    """A serial line, by pyserial."""

    _LONGEST_READ_S = 0.1

    def __init__(self, name: str, device: str, baud: int) -> None:
        try:
            import serial
        except ImportError:
            raise UserError(name, "needs pyserial, which is not installed", INSTALL) from None
        self._make = lambda: serial.Serial(
            device, baud, timeout=self._LONGEST_READ_S, write_timeout=2.0, exclusive=True
        )
        super().__init__(name)

    def _open(self) -> Any:
        return self._make()

    def _read(self, timeout_s: float) -> bytes:
        self._end.timeout = min(timeout_s, self._LONGEST_READ_S)
        return bytes(self._end.read(max(self._end.in_waiting, 1)))

    def _write(self, data: bytes) -> None:
        self._end.write(data)
