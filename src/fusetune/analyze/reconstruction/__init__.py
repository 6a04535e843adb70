"""Gives the estimator back what the logger left out: IMU rows, magnetometer and barometer samples; never GNSS.

The functions are loaded when they are asked for: the workflow reads the settings whenever it starts.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fusetune.analyze.reconstruction.measured import measured_rows
    from fusetune.analyze.reconstruction.reconstructed_flight import (
        RECONSTRUCTION_TOPICS,
        ReconstructedFlight,
        Step,
        as_logged,
        reconstruct,
    )
    from fusetune.analyze.reconstruction.settings import ReconstructionSettings

__all__ = [
    "RECONSTRUCTION_TOPICS",
    "ReconstructedFlight",
    "ReconstructionSettings",
    "Step",
    "as_logged",
    "measured_rows",
    "reconstruct",
]

_MODULES = {"measured_rows": "measured", "ReconstructionSettings": "settings"}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES.get(name, 'reconstructed_flight')}"), name)
