"""The outcome of one check of a flight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Status = Literal["pass", "warning", "fail", "does-not-apply"]


@dataclass(frozen=True)
class Check:
    """Outcome of one check."""

    name: str
    status: Status
    reason: str
    """What was found, in words; for warnings and failures what is wrong."""
    remedy: str = ""
    figure: float | None = None
    threshold: float | None = None
