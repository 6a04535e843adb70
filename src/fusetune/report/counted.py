"""Numbers of things and lists of names, in words."""

from __future__ import annotations

from collections.abc import Sequence


def count_words(count: int, noun: str) -> str:
    """As `1 flight`, `3 flights`."""
    return f"{count} {noun}{'s' if count != 1 else ''}"


def listed(names: Sequence[str], most: int = 3, between: str = ", ") -> str:
    """The first few names, and how many more there are."""
    more = len(names) - most
    return between.join(names[:most]) + (f" and {more} more" if more > 0 else "")
