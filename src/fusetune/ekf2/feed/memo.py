"""What follows from a flight and a few values, worked out once and shared by all who ask, in threads too."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import TypeVar, cast

MOST_BYTES = 96 * 2**20

Value = TypeVar("Value")


class Memo:
    """Keeps what was asked for last, up to a number of bytes; the last is kept whatever its size.

    Who asks while another works out waits for it. A copy in another process starts empty.
    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most_bytes = most_bytes
        self._lock = threading.RLock()
        self._kept: OrderedDict[Hashable, tuple[object, int]] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Value], size: Callable[[Value], int] = lambda value: 0) -> Value:
        """The value under a key; where it is not known, `make` makes it, of `size` bytes."""
        with self._lock:
            if key not in self._kept:
                value = make()
                self._kept[key] = value, size(value)
                while len(self._kept) > 1 and sum(held for _, held in self._kept.values()) > self._most_bytes:
                    self._kept.popitem(last=False)
            self._kept.move_to_end(key)
            return cast(Value, self._kept[key][0])

    def __reduce__(self) -> tuple[type[Memo], tuple[int]]:
        return Memo, (self._most_bytes,)
