"""A byte stream for pyulog that cannot send it in circles.

Where a record is damaged, pyulog steps back to the byte after the record's head. It computes the step from the length
that the record claims; near the end of a file less than that was read, and it would step back too far and meet the same
record for ever. Long stretches of rubbish it goes through byte by byte.
"""

from __future__ import annotations

import io

_MOST_STEPS_BACK = 500_000


class GuardedStream(io.BytesIO):
    """Bytes in memory whose steps back never exceed what was read, and that end after too many of them.

    Attributes
    ----------
    gave_up_at
        Position at which the stream pretended to end, `None` where it did not.
    """

    def __init__(self, content: bytes, most_steps_back: int = _MOST_STEPS_BACK) -> None:
        super().__init__(content)
        self.gave_up_at: int | None = None
        self._steps_left = most_steps_back
        self._not_delivered = 0

    def read(self, size: int | None = -1, /) -> bytes:
        """As `io.BytesIO.read`, or nothing after too many steps back."""
        if self.gave_up_at is not None:
            return b""
        data = super().read(size)
        self._not_delivered = 0 if size is None or size < 0 else size - len(data)
        return data

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        """As `io.BytesIO.seek`; a relative step back is counted from what the last read was asked for."""
        if whence != io.SEEK_CUR or offset >= 0:
            return super().seek(offset, whence)
        self._steps_left -= 1
        if self._steps_left < 0 and self.gave_up_at is None:
            self.gave_up_at = self.tell()
        position = super().seek(min(offset + self._not_delivered, 0), io.SEEK_CUR)
        self._not_delivered = 0
        return position
