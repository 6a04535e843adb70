"""Where logs and figures lie that are no part of the project: in `../shared`, or where FUSETUNE_SHARED points."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
"""Top folder of the project."""

SHARED = Path(os.environ.get("FUSETUNE_SHARED", ROOT.parent / "shared"))
