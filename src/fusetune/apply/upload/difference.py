"""What would change on the vehicle, as a table for its pilot."""

from __future__ import annotations

from collections.abc import Sequence

from fusetune.apply.upload.journal import Change
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS

_HEAD = ("parameter", "now", "new", "unit", "range", "takes effect")


def difference_table(changes: Sequence[Change]) -> list[str]:
    """Lines of the table, its head first; each begins with a space."""
    rows = [_HEAD, *(_row(change) for change in changes)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEAD))]
    return [
        "  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    ]


def needs_reboot(name: str) -> bool:
    """Whether PX4 takes a value only when it starts."""
    return name in ALL_PARAMETERS and ALL_PARAMETERS[name].reboot_required


def _row(change: Change) -> tuple[str, ...]:
    metadata = ALL_PARAMETERS.get(change.name)
    bounds = (metadata.minimum, metadata.maximum) if metadata else (None, None)
    low, high = ("" if bound is None else f"{bound:g}" for bound in bounds)
    return (
        change.name,
        str(change.old),
        str(change.new),
        metadata.unit if metadata else "",
        f"{low} … {high}" if low or high else "",
        "after a reboot" if change.reboot else "at once",
    )
