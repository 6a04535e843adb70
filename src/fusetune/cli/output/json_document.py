"""`--json`: one document on standard output, and nothing else there."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any


def add_json(parser: argparse.ArgumentParser, what: str = "print one JSON document (docs/command.md)") -> None:
    """Give a sub-command the option."""
    parser.add_argument("--json", action="store_true", help=what)


def print_document(document: Any) -> None:
    """Print it; what is not known, NaN and infinities among it, is null."""
    print(json.dumps(_plain(document), ensure_ascii=False, allow_nan=False, indent=1))


def _plain(value: Any) -> Any:
    """Values as JSON has them: NumPy's and pandas' as Python's, records as mappings, paths as text."""
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: _plain(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
