"""The save room: every log becomes a folder of tables with a verdict.

Why a flight is refused: `verdict` puts the questions of `checks` to it, from the limits in `thresholds`.

The functions load what they need when they are asked for, so that reading a saved flight costs no more than NumPy and
pyarrow.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fusetune.save.flight_folder import load_flight
    from fusetune.save.flights_table import write_flights_table
    from fusetune.save.log_folder import save_log
    from fusetune.save.present import FlightSets, Present, find_present, read_present, write_present
    from fusetune.save.thresholds import VerdictThresholds
    from fusetune.save.verdict import Verdict, judge

__all__ = [
    "FlightSets",
    "Present",
    "Verdict",
    "VerdictThresholds",
    "find_present",
    "judge",
    "load_flight",
    "read_present",
    "save_log",
    "write_flights_table",
    "write_present",
]

_MODULES = {
    "FlightSets": "present",
    "Present": "present",
    "Verdict": "verdict",
    "VerdictThresholds": "thresholds",
    "find_present": "present",
    "judge": "verdict",
    "load_flight": "flight_folder",
    "read_present": "present",
    "save_log": "log_folder",
    "write_flights_table": "flights_table",
    "write_present": "present",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
