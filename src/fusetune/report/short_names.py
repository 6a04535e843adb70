"""Names of flights short enough for tables and charts."""

from __future__ import annotations

_LONGEST_NAME = 30


def shortened(name: str, longest: int = _LONGEST_NAME) -> str:
    """A name that leaves room for the plot: its middle goes, as flights often differ at the end."""
    if len(name) <= longest:
        return name
    head = (longest - 1) // 3
    return f"{name[:head]}…{name[-(longest - 1 - head) :]}"


def flight_labels(names: list[str]) -> list[str]:
    """Names of flights without the beginning that they share, where they are long."""
    if max(map(len, names)) <= _LONGEST_NAME:
        return names
    # What the first and the last in alphabetical order share, all between them share.
    first, last = min(names), max(names)
    shared = next((i for i, pair in enumerate(zip(first, last, strict=False)) if pair[0] != pair[1]), 0)
    return [shortened(f"…{name[shared:]}" if shared > 3 else name) for name in names]
