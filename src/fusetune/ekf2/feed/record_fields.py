"""Fields of the records that kernels take, several of one type at a time."""

from __future__ import annotations

from typing import Any


def fields(kind: Any, *names: str, shape: tuple[int, ...] = ()) -> list[tuple[str, Any, tuple[int, ...]]]:
    """Fields of one type and shape, as `numpy.dtype` takes them."""
    return [(name, kind, shape) for name in names]
