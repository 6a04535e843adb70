"""Tables in text: columns as wide as they need to be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence


def table_lines(rows: Sequence[Sequence[str]], right: Sequence[int] = (), indent: str = "") -> Iterator[str]:
    """Rows in lines, the head among them.

    Parameters
    ----------
    right : columns of figures, by number
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (
            cell.rjust(width) if number in right else cell.ljust(width)
            for number, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        yield (indent + "  ".join(cells)).rstrip()


def percent(value: float | None, digits: int = 1) -> str:
    """A change in percent with its sign; – where it is not known."""
    if value is None or value != value:
        return "–"
    text = f"{value:+.{digits}f} %".replace("-", "−")
    return text if any(one in "123456789" for one in text) else f"{0:.{digits}f} %"


def interval(lower: float | None, upper: float | None) -> str:
    """An interval of a change in percent."""
    if lower is None or upper is None or lower != lower or upper != upper:
        return "not known"
    return f"{lower:+.1f} to {upper:+.1f} %".replace("-", "−")
